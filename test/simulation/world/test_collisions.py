import numpy as np
import pytest
import shapely

from simbev_ros.simulation.world.kinematics.collisions import Collisions
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes

TICK_S = 0.05
CAR_M = [4.6, 2.0, 1.5]
PEDESTRIAN_M = [0.6, 0.5, 1.7]


def outlines(boxes, position_m, yaw_rad):
    c, s = np.cos(yaw_rad)[:, None], np.sin(yaw_rad)[:, None]
    x = boxes.size_m[:, :1] / 2.0 * [1, -1, -1, 1]
    y = boxes.size_m[:, 1:2] / 2.0 * [1, 1, -1, -1]
    return shapely.polygons(np.stack([position_m[:, :1] + c * x - s * y, position_m[:, 1:2] + s * x + c * y], axis=-1))


def test_boxes_touch_where_their_outlines_and_heights_overlap():
    rng = np.random.default_rng(3)
    count, vehicles = 300, 100
    size_m = np.where(
        np.arange(count)[:, None] < vehicles, rng.uniform([2, 1, 1], [12, 3, 3], (count, 3)), PEDESTRIAN_M
    )
    position_m = rng.uniform([0, 0, 0], [80, 80, 8], (count, 3))
    yaw_rad = rng.uniform(-np.pi, np.pi, count)
    boxes = BodyBoxes(size_m, vehicles)
    shapes = outlines(boxes, position_m, yaw_rad)
    bottom, top = position_m[:, 2], position_m[:, 2] + size_m[:, 2]
    expected = [
        (a, b)
        for a in range(vehicles)
        for b in range(a + 1, count)
        if shapes[a].intersects(shapes[b]) and bottom[a] < top[b] and bottom[b] < top[a]
    ]
    assert len(expected) > 40
    assert list(map(tuple, boxes.touching_pairs(position_m, yaw_rad).tolist())) == expected


def play(boxes, start_m, velocity_mps, yaw_rad, ticks=80):
    """(T, G, 3) positions of bodies that try to move straight ahead, and the collisions of each tick."""
    rpy_rad = np.column_stack([np.zeros((len(start_m), 2)), yaw_rad])
    collisions = Collisions(boxes, start_m, rpy_rad, TICK_S)
    positions_m, impacts = [start_m], []
    for tick in range(1, ticks):
        positions_m.append(collisions.resolve(start_m + tick * TICK_S * velocity_mps, rpy_rad)[0])
        impacts.append(collisions.impacts)
    return np.array(positions_m), impacts, collisions


def test_two_cars_head_on_stop_against_each_other_and_stay():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M]), 2)
    start_m, velocity_mps = np.array([[-20.0, 0, 0], [20.0, 0.5, 0]]), np.array([[10.0, 0, 0], [-10.0, 0, 0]])
    positions_m, impacts, collisions = play(boxes, start_m, velocity_mps, np.array([0.0, np.pi]))
    (impact,) = [impact for at_tick in impacts for impact in at_tick]
    assert impact.bodies == (0, 1)
    assert impact.relative_speed_mps == pytest.approx(20.0)
    assert np.abs(impact.position_m).max() < 0.6
    assert positions_m[-1, 1, 0] - positions_m[-1, 0, 0] == pytest.approx(4.6, abs=0.02)
    assert np.array_equal(positions_m[-1], positions_m[-20])
    assert collisions.crashed.all()


def test_cars_that_start_far_from_each_other_crash_where_they_meet():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M]), 2)
    start_m, velocity_mps = np.array([[-150.0, 0, 0], [90.0, 0, 0]]), np.array([[50.0, 0, 0], [-30.0, 0, 0]])
    _, impacts, _ = play(boxes, start_m, velocity_mps, np.array([0.0, np.pi]))
    (tick,) = [tick for tick, at_tick in enumerate(impacts, 1) if at_tick]
    assert tick == np.ceil((240.0 - 4.6) / (80.0 * TICK_S))
    assert impacts[tick - 1][0].position_m[0] == pytest.approx(0.0, abs=1.5)


def test_a_car_hit_from_behind_is_pushed_until_both_have_braked():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M]), 2)
    start_m, velocity_mps = np.array([[-12.3, 0, 0], [0.0, 0, 0]]), np.array([[12.0, 0, 0], [0.0, 0, 0]])
    positions_m, _, collisions = play(boxes, start_m, velocity_mps, np.zeros(2))
    # The momentum is shared at 6 m/s; locked wheels brake 7 m/s².
    assert positions_m[-1, 1, 0] == pytest.approx(6.0**2 / 2 / 7.0, abs=0.25)
    assert np.diff(positions_m[-1, :, 0]) == pytest.approx(4.6, abs=0.02)
    np.testing.assert_allclose(collisions.rest_m, positions_m[-1])


def test_a_pile_up_leaves_no_boxes_overlapping_at_any_tick():
    rng = np.random.default_rng(1)
    yaw_rad = rng.uniform(-np.pi, np.pi, 40)
    ring_m = 30.0 + 8.0 * (np.arange(40) // 10)
    angle_rad = 2.0 * np.pi * np.arange(40) / 10
    start_m = np.column_stack([ring_m * np.cos(angle_rad), ring_m * np.sin(angle_rad), np.zeros(40)])
    boxes = BodyBoxes(np.array([CAR_M] * 30 + [PEDESTRIAN_M] * 10), 30)
    velocity_mps = -start_m / 3.0 * rng.uniform(0.7, 1.3, (40, 1))
    positions_m, impacts, _ = play(boxes, start_m, velocity_mps, yaw_rad)
    assert sum(map(len, impacts)) > 10
    for at_tick_m in positions_m[1:]:
        shapes = outlines(boxes, at_tick_m, yaw_rad)
        a, b = shapely.STRtree(shapes).query(shapes, predicate="intersects")
        pairs = (a < b) & (a < 30)
        assert shapely.area(shapely.intersection(shapes[a[pairs]], shapes[b[pairs]])).max(initial=0.0) < 1e-6


def test_a_car_below_a_bridge_hits_nothing_on_it():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M]), 2)
    start_m, velocity_mps = np.array([[-20.0, 0, 0], [20.0, 0, 5.0]]), np.array([[10.0, 0, 0], [-10.0, 0, 0]])
    _, impacts, collisions = play(boxes, start_m, velocity_mps, np.array([0.0, np.pi]))
    assert not any(impacts)
    assert not collisions.crashed.any()


def test_bodies_that_overlap_from_the_start_may_separate():
    boxes = BodyBoxes(np.array([CAR_M, PEDESTRIAN_M]), 1)
    start_m, velocity_mps = np.array([[0.0, 0, 0], [0.0, 1.0, 0]]), np.array([[0.0, 0, 0], [0.0, 1.0, 0]])
    positions_m, impacts, _ = play(boxes, start_m, velocity_mps, np.zeros(2))
    assert not any(impacts)
    assert positions_m[-1, 1, 1] > 4.0


def test_bodies_that_overlap_from_the_start_may_be_kept_from_separating():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M, CAR_M]), 3)
    start_m = np.array(
        [[0.0, 0, 0], [4.55, 0, 0], [9.16, 0, 0]]
    )  # the first two overlap by 5 cm; the third is 1 cm ahead
    velocity_mps = np.array([[0.0, 0, 0], [10.0, 0, 0], [0.0, 0, 0]])
    positions_m, impacts, collisions = play(boxes, start_m, velocity_mps, np.zeros(3))
    assert [impact.bodies for at_tick in impacts for impact in at_tick] == [(1, 2)]
    assert collisions.crashed.tolist() == [False, True, True]
    assert positions_m[-1, 0, 0] == 0.0


def test_a_car_that_hits_a_parked_one_stops_there_and_does_not_push_it_away():
    boxes = BodyBoxes(np.array([CAR_M, CAR_M]), 1)
    start_m, rpy_rad = np.array([[-20.0, 0, 0], [0.0, 0.5, 0]]), np.zeros((2, 3))
    collisions = Collisions(boxes, start_m, rpy_rad, TICK_S, parked=1)
    impacts = []
    for tick in range(1, 80):
        position_m, _ = collisions.resolve(start_m + tick * TICK_S * np.array([[10.0, 0, 0], [0, 0, 0]]), rpy_rad)
        impacts += collisions.impacts
    (impact,) = impacts
    assert impact.bodies == (0, 1)
    assert impact.relative_speed_mps == pytest.approx(10.0)
    assert position_m[1] == pytest.approx(start_m[1], abs=1e-6)
    assert position_m[0, 0] == pytest.approx(-4.6, abs=0.02)
