import numpy as np

from simbev_ros.maps.region import Reach, Reaches, Region, regions_of
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip


def layout_of_line(line_m: list[list[float]]) -> Layout:
    left_m = np.array(line_m)
    return Layout((Strip("a", "a", LaneKind.DRIVING, left_m, left_m - [0.0, 3.0, 0.0]),), (), (), ())


def test_regions_are_squares_numbered_from_the_origin() -> None:
    assert Region(-1, 2).area.bounds == (-512.0, 1024.0, 0.0, 1536.0)


def test_a_map_has_the_regions_around_its_roads_and_no_others() -> None:
    layout = layout_of_line([[200.0, 300.0, 0.0], [300.0, 300.0, 0.0]])
    assert regions_of(layout) == (Region(0, 0),)
    layout = layout_of_line([[200.0, 300.0, 0.0], [450.0, 300.0, 0.0]])
    assert regions_of(layout) == (Region(0, 0), Region(1, 0))


def test_a_scene_has_the_regions_within_its_reach() -> None:
    x = np.arange(0.0, 5000.0, 50.0)
    layout = layout_of_line([[value, 256.0, 0.0] for value in x])
    reached = regions_of(layout, Reach((2600.0, 256.0), 600.0))
    assert reached == (Region(3, 0), Region(4, 0), Region(5, 0), Region(6, 0))


def test_two_circles_have_the_regions_of_both_and_none_between() -> None:
    layout = layout_of_line([[value, 256.0, 0.0] for value in np.arange(0.0, 5000.0, 50.0)])
    west, east = Reach((256.0, 256.0), 100.0), Reach((4000.0, 256.0), 300.0)
    assert regions_of(layout, Reaches((west, east))) == (*regions_of(layout, west), *regions_of(layout, east))
    assert regions_of(layout, Reaches((west, west))) == regions_of(layout, west) == (Region(0, 0),)
