"""A record as on /ego/hd_map."""

from typing import Any

LANE: dict[str, Any] = {
    "stamp_ns": 3_604_050_000_000,
    "id": "7/0/-1",
    "s": 12.5,
    "road_id": "7",
    "section_id": 0,
    "lane_id": -1,
    "lane_type": "Driving",
    "lane_width": 3.25,
    "lane_change": "Right",
    "is_junction": True,
    "junction_id": "4",
    "is_intersection": True,
    "transform": {"location": [1.0, -2.0, 0.5], "rotation": [1.0, -2.0, 90.0]},
    "left_lane_marking": {"type": "Solid", "width": 0.12, "color": "Yellow", "lane_change": "NONE"},
    "right_lane_marking": {"type": "SolidBroken", "width": 0.12, "color": "White", "lane_change": "Left"},
    "left_lane": None,
    "right_lane": {"id": "7/0/-2", "road_id": "7", "section_id": 0, "lane_id": -2, "lane_type": "Shoulder"},
}
