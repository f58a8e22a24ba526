"""Bodies stand on the surface below their wheels, on the correct level."""

from itertools import pairwise

import numpy as np
import pytest
import shapely

from simbev_ros.foundation.geometry.transforms import rotations_from_rpy
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M, LaneKind
from simbev_ros.maps.roads.layout import Layout, Strip
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.footing import ContactPoints, GroundPlanes
from simbev_ros.simulation.world.kinematics.ground import GroundSurface
from simbev_ros.simulation.world.kinematics.motion import Bodies, Motion
from simbev_ros.simulation.world.kinematics.raised_areas import RaisedAreas

TICK_S = 0.05
WHEELS = ContactPoints(np.zeros(4, np.int64), np.array([1.4, 1.4, -1.4, -1.4]), np.array([0.8, -0.8, 0.8, -0.8]))
FOOT = ContactPoints(np.zeros(1, np.int64), np.zeros(1), np.zeros(1))


def strip(name, line_m, width_m=8.0, level=0, cross_slope=0.0, kind=LaneKind.DRIVING):
    """A straight strip along an (N, 3) line, rising to the left by ``cross_slope``."""
    heading = (line_m[-1] - line_m[0])[:2] / np.linalg.norm((line_m[-1] - line_m[0])[:2])
    left = np.array([-heading[1], heading[0], cross_slope]) * width_m / 2.0
    return Strip(name, name, kind, line_m + left, line_m - left, level=level)


def layout(*strips):
    return Layout(strips, (), (), ())


def line(height, start_m=-100.0, stop_m=400.0):
    """A line along x, at the heights given by a function of x."""
    x = np.arange(start_m, stop_m + 1.0, 2.0)
    return np.column_stack([x, np.zeros(len(x)), [height(each) for each in x]])


def drive(ground, height, contacts=WHEELS, speed_mps=12.0, seconds=12.0, y_m=0.0):
    """Origins and kinematics of a car that drives along x, led by points on the road."""
    boxes = BodyBoxes(np.ones((1, 3)), 1)
    bodies = Bodies(
        np.zeros(1, np.int64), np.array([3.6]), np.array([2.2]), np.array([False]), np.zeros((1, 3)), contacts, boxes
    )
    x = speed_mps * TICK_S * np.arange(int(seconds / TICK_S))
    points = np.stack([x, np.full(len(x), y_m), [height(each) for each in x], np.zeros(len(x))], axis=1)[:, None]
    motion = Motion(bodies, points[0], np.array([[1.0, 0.0, 0.0]]), TICK_S, 7, GroundPlanes(ground, contacts))
    states = [motion.advance_motion(point) for point in points][40:]
    return np.concatenate([state.position_m for state in states]), states


def wheels_m(states):
    """(T, 4, 3) contact points of the car."""
    contacts_m = np.column_stack([WHEELS.ahead_m, WHEELS.left_m, np.zeros(4)])
    return np.stack([s.position_m + contacts_m @ rotations_from_rpy(s.rpy_rad)[0].T for s in states])


def test_on_a_tilted_plane_all_wheels_touch_and_the_body_pitches_and_rolls_with_it():
    road = strip("road", line(lambda x: 0.1 * x), width_m=12.0, cross_slope=0.05)
    _, states = drive(GroundSurface(layout(road)), lambda x: 0.1 * x, y_m=2.0)
    wheels = wheels_m(states)
    assert np.abs(wheels[..., 2] - (0.1 * wheels[..., 0] + 0.05 * wheels[..., 1])).max() < 1e-3
    roll, pitch, yaw = states[-1].rpy_rad[0]
    assert pitch == pytest.approx(-np.arctan(0.1), abs=1e-4), "nose up"
    assert roll == pytest.approx(np.arctan(0.05 * np.cos(pitch)), abs=1e-4), "left side up"
    assert yaw == 0.0


def test_roads_and_shoulders_are_paved_but_not_sidewalks():
    center_m, beside_m = line(lambda x: 6.0), np.array([0.0, 5.0, 0.0])
    shoulder = strip("shoulder", center_m + beside_m, width_m=2.0, kind=LaneKind.SHOULDER)
    walk = strip("walk", center_m - beside_m, width_m=2.0, kind=LaneKind.SIDEWALK)
    ground = GroundSurface(layout(strip("road", center_m), shoulder, walk))
    points_m = np.array([(50.0, y_m, 6.0) for y_m in (3.9, 5.9, 6.2, -3.9, -4.5, 8.0)])
    assert ground.is_paved(points_m).tolist() == [True, True, False, True, False, False]


def test_a_pedestrian_stays_upright_on_a_slope():
    road = strip("road", line(lambda x: 0.1 * x), cross_slope=0.05)
    origins_m, states = drive(GroundSurface(layout(road)), lambda x: 0.1 * x, FOOT, speed_mps=1.5, seconds=8.0)
    assert np.all(states[-1].rpy_rad == 0.0)
    assert np.abs(origins_m[:, 2] - 0.1 * origins_m[:, 0]).max() < 1e-3


@pytest.mark.parametrize("radius_m", [400.0, -250.0])
def test_wheels_stay_within_three_centimeters_of_the_road_on_crests_and_in_dips(radius_m):
    def height(x):
        return 5.0 - (x - 70.0) ** 2 / (2.0 * radius_m)

    _, states = drive(GroundSurface(layout(strip("road", line(height)))), height, speed_mps=15.0)
    wheels = wheels_m(states)
    assert np.abs(wheels[..., 2] - height(wheels[..., 0])).max() < 0.03
    mean_mps2 = np.mean([state.acceleration_mps2[0, 2] for state in states])
    assert mean_mps2 == pytest.approx(-(15.0**2) / radius_m, rel=0.03)


def test_derivatives_are_those_of_the_poses():
    def height(x):
        return 2.0 * np.sin(x / 25.0)

    origins_m, states = drive(GroundSurface(layout(strip("road", line(height), cross_slope=0.03))), height)
    velocity_mps = np.concatenate([state.velocity_mps for state in states])
    path_m = np.cumsum((velocity_mps[1:] + velocity_mps[:-1]) / 2.0 * TICK_S, axis=0)
    np.testing.assert_allclose(origins_m[1:] - origins_m[0], path_m, atol=5e-3)
    for before, after in pairwise(states):
        turn = rotations_from_rpy(after.rpy_rad)[0] @ rotations_from_rpy(before.rpy_rad)[0].T
        vector = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2.0 / TICK_S
        mean = (before.angular_velocity_radps[0] + after.angular_velocity_radps[0]) / 2.0
        np.testing.assert_allclose(vector, mean, atol=5e-3)


def crossing():
    """A road along x that climbs onto a deck, level 1 from x = 40 to 120, above a road along y at x = 80."""

    def height(x):
        return 6.0 * np.clip(x / 50.0, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(x / 50.0, 0.0, 1.0))

    below = np.column_stack([np.full(101, 80.0), np.arange(-100.0, 101.0, 2.0), np.zeros(101)])
    return height, layout(
        strip("west", line(height, -100.0, 40.0)),
        strip("deck", line(height, 40.0, 120.0), level=1),
        strip("east", line(height, 120.0, 400.0)),
        strip("below", below),
    )


def test_levels_are_distinguished_by_height():
    height, roads = crossing()
    points_m = np.array([[80, 0, 6.0], [80, 0, 0.0], [80, 0, 6.4], [80, 0, -0.4], [80, 4.3, 6.0], [41, 0, height(41)]])
    assert GroundSurface(roads).levels(points_m).tolist() == [1, 0, 1, 0, 1, 1]
    assert GroundSurface(roads).levels(np.array([[39.0, 0.0, height(39)], [80, 20, 0], [80, 20, 6.0]])).tolist() == [
        0,
        0,
        0,
    ]
    assert GroundSurface(roads).heights_m(points_m[:2]) == pytest.approx([6.0, 0.0], abs=0.01)


def test_a_car_drives_onto_a_deck_and_off_again_without_a_jump():
    height, roads = crossing()
    origins_m, states = drive(GroundSurface(roads), height)
    wheels = wheels_m(states)
    assert np.abs(wheels[..., 2] - height(wheels[..., 0])).max() < 0.03
    assert np.abs([state.acceleration_mps2[0, 2] for state in states]).max() < 3.0
    assert origins_m[-1, 0] > 125.0


def test_a_sidewalk_rises_by_the_curb_height_on_its_own_level_only():
    x = np.arange(0.0, 101.0, 2.0)
    upper = np.column_stack([x, np.full(len(x), 5.5), np.full(len(x), 6.0)])
    ground = GroundSurface(
        layout(
            strip("below", np.column_stack([x, np.zeros(len(x)), np.zeros(len(x))]), width_m=20.0),
            strip("deck", np.column_stack([x, np.zeros(len(x)), np.full(len(x), 6.0)]), level=1),
            strip("walk", upper, width_m=3.0, level=1, kind=LaneKind.SIDEWALK),
        )
    )
    points_m = np.array([[50.0, 5.5, 6.0], [50.0, 5.5, 0.0], [50.0, 0.0, 6.0]])
    assert ground.raised_m(points_m).tolist() == [CURB_HEIGHT_M, 0.0, 0.0]


def test_the_ground_of_a_part_of_a_map_has_the_sidewalks_that_it_has_alone():
    road = strip("road", line(lambda x: 0.0), width_m=10.0)
    walk = strip("walk", line(lambda x: 0.0) + np.array([0.0, 6.5, 0.0]), width_m=3.0, kind=LaneKind.SIDEWALK)
    far = strip("far", line(lambda x: 0.0) + np.array([2000.0, 6.5, 0.0]), width_m=3.0, kind=LaneKind.SIDEWALK)
    whole = layout(road, walk, far)
    part = whole.near(shapely.box(0.0, -20.0, 100.0, 20.0), 50.0)
    points_m = np.column_stack([np.full(141, 50.0), np.linspace(-14.0, 14.0, 141), np.zeros(141)])
    raised_m = GroundSurface(part, RaisedAreas(whole)).raised_m(points_m)
    assert len(part.strips) == 2
    assert raised_m.tolist() == GroundSurface(part).raised_m(points_m).tolist()
    assert np.array_equal(raised_m > 0.0, (points_m[:, 1] > 5.0) & (points_m[:, 1] < 8.0))


def test_areas_that_are_read_from_the_cache_equal_those_that_were_built(tmp_path):
    streets = layout(
        strip("road", line(lambda x: 0.0), width_m=10.0),
        strip("walk", line(lambda x: 0.0) + np.array([0.0, 6.5, 0.0]), width_m=3.0, kind=LaneKind.SIDEWALK),
    )
    folder = tmp_path / "sidewalks" / "map"
    built = RaisedAreas(streets, walks_on_land=True).in_cell(0, 0, 0)
    written = RaisedAreas(streets, walks_on_land=True, folder=folder).in_cell(0, 0, 0)
    read = RaisedAreas(layout(strip("other", line(lambda x: 9.0))), walks_on_land=True, folder=folder).in_cell(0, 0, 0)
    assert len(built) == 2
    assert all(not area.is_empty for area, _ in built)
    for areas in (written, read):
        assert [(shapely.to_wkb(area), high_m) for area, high_m in areas] == [
            (shapely.to_wkb(area), high_m) for area, high_m in built
        ]


def test_damaged_areas_in_the_cache_are_built_again(tmp_path):
    streets = layout(strip("walk", line(lambda x: 6.5), width_m=3.0, kind=LaneKind.SIDEWALK))
    folder = tmp_path / "sidewalks" / "map"
    (area, _), *_ = RaisedAreas(streets, folder=folder).in_cell(0, 0, 0)
    file = folder / "0_0_0.npz"
    file.write_bytes(file.read_bytes()[:-20])
    (again, _), *_ = RaisedAreas(streets, folder=folder).in_cell(0, 0, 0)
    assert shapely.to_wkb(again) == shapely.to_wkb(area)
