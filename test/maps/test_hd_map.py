from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from road_strips import layout_of_strips, side_by_side, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.hd_map import lane_record
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Layout, Line, Paint, PaintColor

_KEYS = [
    *("id", "s", "road_id", "section_id", "lane_id", "lane_type", "lane_width", "lane_change", "is_junction"),
    *("junction_id", "is_intersection", "transform", "left_lane_marking", "right_lane_marking"),
    *("left_lane", "right_lane"),
]


def _rising(xy_m: Float64Array) -> Float64Array:
    return np.asarray(0.1 * xy_m[:, 0] + 0.05 * xy_m[:, 1])


def _network(layout: Layout) -> SimpleNamespace:
    return SimpleNamespace(lane_strips=LaneStrips(layout))


@pytest.fixture
def road() -> Layout:
    """Two lanes to the east with a shoulder on the right, and one back."""
    left, right, shoulder = side_by_side(3, name="e", start_m=(0, 0), end_m=(100, 0), height=_rising)
    back = straight("back", (100, 3.5), (0, 3.5), _rising)
    center = Line(Paint.SOLID_BROKEN, PaintColor.YELLOW, 0.15)
    edge = Line(Paint.SOLID, width_m=0.2)
    return layout_of_strips(
        replace(left, left="back", right="e1", left_line=center, right_line=Line(Paint.BROKEN), s_start_m=7.0),
        replace(right, left="e0", right="e2", left_line=Line(Paint.BROKEN), right_line=edge, section=2, junction="j9"),
        replace(shoulder, left="e1", kind=LaneKind.SHOULDER),
        replace(back, left="e0"),
    )


def test_record_of_a_lane_worked_by_hand(road: Layout) -> None:
    record = lane_record(_network(road), np.array([40.0, 0.5, 4.0]), 0.1)
    assert list(record) == _KEYS
    transform = record.pop("transform")
    assert record == {
        "id": "e0",
        "s": pytest.approx(47.0),
        "road_id": "e0",
        "section_id": 0,
        "lane_id": -1,
        "lane_type": "Driving",
        "lane_width": pytest.approx(3.5),
        "lane_change": "Right",
        "is_junction": False,
        "junction_id": None,
        "is_intersection": False,
        "left_lane_marking": {"type": "SolidBroken", "width": 0.15, "color": "Yellow", "lane_change": "Right"},
        "right_lane_marking": {"type": "Broken", "width": 0.12, "color": "White", "lane_change": "Both"},
        "left_lane": {"id": "back", "road_id": "back", "section_id": 0, "lane_id": -1, "lane_type": "Driving"},
        "right_lane": {"id": "e1", "road_id": "e1", "section_id": 2, "lane_id": -2, "lane_type": "Driving"},
    }
    assert transform["location"] == pytest.approx([40.0, 0.0, 4.0])
    assert transform["rotation"] == pytest.approx([np.degrees(np.arctan(0.05)), -np.degrees(np.arctan(0.1)), 0.0])


def test_lane_inside_a_junction_beside_a_shoulder(road: Layout) -> None:
    record = lane_record(_network(road), np.array([40.0, -3.0, 4.0]), 0.0)
    assert (record["lane_id"], record["section_id"], record["lane_change"]) == (-2, 2, "Left")
    assert (record["is_junction"], record["is_intersection"], record["junction_id"]) == (True, True, "j9")
    marking = {"type": "Solid", "width": 0.2, "color": "White", "lane_change": "NONE"}
    assert record["right_lane_marking"] == marking
    assert record["right_lane"]["lane_type"] == "Shoulder"


def test_heading_chooses_the_direction(road: Layout) -> None:
    between_m = np.array([40.0, 1.9, 4.0])
    ids = [lane_record(_network(road), between_m, yaw_rad)["id"] for yaw_rad in (0.0, np.pi)]
    assert ids == ["e0", "back"]
    assert lane_record(_network(road), np.array([40.0, 3.5, 4.0]), np.pi)["left_lane"]["id"] == "e0"
