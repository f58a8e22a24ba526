from dataclasses import replace
from itertools import pairwise

import numpy as np
from road_strips import layout_of_strips, level_ground, straight

from simbev_ros.maps.lane_links import halting_strips, strip_links, strips_at
from simbev_ros.maps.network import Lane
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import StopLine, Strip


def stretches(lane: str, y: float, *cuts_m: float, **fields: object) -> list[Strip]:
    """A lane along x, cut into stretches; from high to low x if the cuts go down."""
    return [
        replace(
            straight(f"{lane}/{number}", (start, y), (end, y), level_ground),
            lane=lane,
            s_start_m=abs(start - cuts_m[0]),
            **fields,  # type: ignore[arg-type]
        )
        for number, (start, end) in enumerate(pairwise(cuts_m))
    ]


def test_stretches_follow_each_other_and_touch_those_that_are_beside_them() -> None:
    right = stretches("r", 0.0, 0, 40, 100, left="l", following=("on", "gone"))
    left = stretches("l", 3.5, 0, 70, 100, right="r", left="o")
    oncoming = stretches("o", 7.0, 100, 60, 0, left="l")
    onward = stretches("on", 0.0, 100, 150)
    strips = [*reversed(right), *left, *oncoming, *onward]
    links = {strip.id: each for strip, each in zip(strips, strip_links(strips), strict=True)}
    assert links["r/0"].successors == ("r/1",)
    assert (links["r/1"].successors, links["r/1"].predecessors) == (("on/0",), ("r/0",))
    assert (links["on/0"].predecessors, links["on/0"].successors) == (("r/1",), ())
    assert (links["r/0"].left, links["r/1"].left, links["r/0"].right) == (("l/0",), ("l/0", "l/1"), ())
    assert (links["l/0"].right, links["l/1"].right) == (("r/0", "r/1"), ("r/1",))
    assert (links["l/0"].left, links["l/1"].left) == (("o/0", "o/1"), ("o/0",))
    assert (links["o/0"].left, links["o/1"].left) == (("l/0", "l/1"), ("l/0",))


def test_those_who_halt_at_a_line_drive_towards_it_on_its_level() -> None:
    there, back = straight("there", (0, 0), (50, 0), level_ground), straight("back", (50, 3), (0, 3), level_ground)
    walk = replace(straight("walk", (0, -3), (50, -3), level_ground), kind=LaneKind.SIDEWALK)
    above = replace(straight("above", (0, 0), (50, 0), level_ground), level=1)
    driven = LaneStrips(layout_of_strips(there, back, walk, above))
    bar_m = np.array([[49.0, -4.0, 0], [49.0, 4.0, 0]])
    stop_lines = [
        StopLine(bar_m),
        StopLine(bar_m[::-1]),
        StopLine(bar_m, level=1),
        StopLine(bar_m + np.array([5.0, 0, 0])),
    ]
    assert list(halting_strips(stop_lines, driven)) == [("there",), ("back",), ("above",), ()]
    assert list(halting_strips(stop_lines[:1], LaneStrips(layout_of_strips(walk)))) == [()]
    assert list(halting_strips([], driven)) == []
    (only,) = halting_strips([StopLine(bar_m[::-1])], LaneStrips(layout_of_strips(there, walk)))
    assert only == ("there",)  # whichever way the line looks


def test_places_of_the_traffic_are_on_the_strip_below_in_its_direction() -> None:
    first, second = stretches("r", 0.0, 0, 40, 100)
    driven = LaneStrips(layout_of_strips(first, second, straight("o", (100, 0.5), (0, 0.5), level_ground)))
    line_m = np.array([[0.0, 0.2, 0], [100.0, 0.2, 0]])
    lane = Lane("x_0", "x", 0, LaneKind.DRIVING, line_m, 3.5, 10.0, "", ())
    aside = replace(lane, centerline_m=line_m + np.array([0.0, 9.0, 0.0]))
    assert strips_at([(lane, 10.0), (lane, 90.0), (aside, 10.0)], driven) == ["r/0", "r/1", ""]
    assert strips_at([], driven) == []
