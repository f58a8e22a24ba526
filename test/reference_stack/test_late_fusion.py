"""Boxes of several agents are merged: an object that both have found is one box, and the agent itself is none."""

import numpy as np
import pytest

from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.reference_stack.fusion import fuse_boxes
from simbev_ros.reference_stack.messages import header_of, table_message, table_of
from simbev_ros.reference_stack.pipeline import BOX_DTYPE
from simbev_ros.ros.msgs.tables import message_from_table


def cars(*places_m: tuple[float, float], score: float = 0.5, yaw_rad: float = 0.0, first_id: int = 1) -> Table:
    table = np.zeros(len(places_m), BOX_DTYPE)
    table["x"], table["y"] = np.array(places_m).T if places_m else ((), ())
    table["length"], table["width"], table["height"] = 4.0, 2.0, 1.5
    table["score"], table["yaw"], table["id"] = score, yaw_rad, first_id + np.arange(len(table))
    return table


def pose(x_m: float, y_m: float, yaw_rad: float = 0.0) -> Float64Array:
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(yaw_rad), -np.sin(yaw_rad)], [np.sin(yaw_rad), np.cos(yaw_rad)]]
    matrix[:2, 3] = x_m, y_m
    return matrix


AFAR = pose(-100, 0)


def test_an_object_that_both_have_found_is_the_more_certain_of_the_two_boxes() -> None:
    own, other = cars((10, 0), score=0.5), cars((10.5, 0.3), (30, 0), score=0.8)
    fused = fuse_boxes([own, other], AFAR)
    assert sorted(fused["x"].tolist()) == [10.5, 30]
    assert fused["score"][fused["x"].argsort()].tolist() == pytest.approx([0.9, 0.8])
    assert len(set(fused["id"].tolist())) == 2
    assert fused.dtype == BOX_DTYPE


def test_boxes_of_one_agent_are_never_merged() -> None:
    own = cars((10, 0), (11, 0))
    fused = fuse_boxes([own, cars()], AFAR)
    assert fused["x"].tolist() == [10, 11] and fused["id"].tolist() == [1, 2]


def test_boxes_without_a_track_stay_without_one() -> None:
    loose = cars((30, 0), (60, 0))
    loose["id"] = -1
    fused = fuse_boxes([cars((10, 0)), loose, cars((90, 0))], AFAR)
    assert sorted(fused["id"].tolist()) == [-1, -1, 1, 1 + 2 * (1 << 24)]


@pytest.mark.parametrize(
    ("yaw_rad", "offset_m", "count"),
    [
        (0.0, (2.4, 0), 1),
        (0.0, (0, 2.4), 2),
        (np.pi / 2, (2.4, 0), 2),
        (np.pi / 2, (0, 2.4), 1),
        (0.0, (2.6, 0), 2),
    ],
)
def test_the_sides_of_the_more_certain_box_decide_what_is_the_same(
    yaw_rad: float, offset_m: tuple[float, float], count: int
) -> None:
    own = cars((10, 0), score=0.9, yaw_rad=yaw_rad)
    other = cars((10 + offset_m[0], offset_m[1]), score=0.1)
    assert len(fuse_boxes([own, other], AFAR)) == count


def test_boxes_above_each_other_are_two() -> None:
    bridge = cars((10, 0))
    bridge["z"] = 6.0
    assert len(fuse_boxes([cars((10, 0)), bridge], AFAR)) == 2


def test_the_agent_itself_is_not_among_its_boxes_but_what_it_has_found_close_by_is() -> None:
    ego = pose(5, 5, np.pi / 2)
    seen_by_other = cars((5.2, 7), (7.2, 5))  # the ego, and a car beside it
    assert fuse_boxes([cars(), seen_by_other], ego)["x"].tolist() == pytest.approx([7.2])
    assert len(fuse_boxes([seen_by_other, cars()], ego)) == 2


def test_nothing_found_is_no_box() -> None:
    assert fuse_boxes([cars(), cars()], AFAR).shape == (0,)


def test_a_table_that_was_sent_is_read_again() -> None:
    boxes = np.frombuffer(np.random.default_rng(0).bytes(3 * BOX_DTYPE.itemsize), BOX_DTYPE)
    assert table_of(table_message(boxes, header_of(1, "map")), BOX_DTYPE).tobytes() == boxes.tobytes()
    wider = np.zeros(3, [("extra", "<u2"), *BOX_DTYPE.descr[::-1]])
    wider["x"] = [1, 2, 3]
    assert table_of(message_from_table(wider, 1, "map"), BOX_DTYPE)["x"].tolist() == [1, 2, 3]
    with pytest.raises(ValueError, match=r"^a table has no column z, but x, y$"):
        table_of(message_from_table(np.zeros(1, [("x", "f8"), ("y", "f8")]), 1, "map"), BOX_DTYPE)
