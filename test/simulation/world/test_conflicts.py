"""Which drivers brake for which, in artificial traffic: each vehicle drives along a given line."""

from collections.abc import Callable

import numpy as np
import pytest

from simbev_ros.simulation.world.driving.backing_off import BackingOff
from simbev_ros.simulation.world.driving.careful_drivers import CarefulDrivers
from simbev_ros.simulation.world.kinematics.contacts import BodyBoxes
from simbev_ros.simulation.world.kinematics.footing import ContactPoints
from simbev_ros.simulation.world.kinematics.motion import Bodies

TICK_S = 0.1
CAR_M, PEDESTRIAN_M = (4.6, 2.0, 1.5), (0.6, 0.5, 1.7)
TRAIL_M, LEAD_M = 2.8, 1.4
Line = Callable[[np.ndarray], np.ndarray]


def straight(x_m: float, y_m: float, yaw_deg: float) -> Line:
    """A straight line through a point, at a heading."""
    ahead = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
    return lambda s_m: np.array([x_m, y_m]) + np.asarray(s_m)[..., None] * ahead


def bend(radius_m: float, sign: float) -> Line:
    """A line along the x axis to 0, then around a bend to the left; with a negative sign, the same road back."""

    def line(s_m: np.ndarray) -> np.ndarray:
        s_m = sign * np.asarray(s_m, float)
        turn = np.clip(s_m / 20.0, 0.0, np.pi / 2.0)
        arc_m = np.stack([radius_m * np.sin(turn), 20.0 - radius_m * np.cos(turn)], axis=-1)
        past_m = np.maximum(s_m - 10.0 * np.pi, 0.0)
        return arc_m + np.stack([np.minimum(s_m, 0.0), past_m], axis=-1)

    return line


class LineTraffic:
    """Vehicles on lines, which drive at their own speeds unless they are limited."""

    def __init__(
        self, lines: list[Line], start_m: list[float], speed_mps: list[float], careful: list[bool] | None = None
    ):
        self.lines, self.s_m, self.desired_mps = lines, np.array(start_m), np.array(speed_mps)
        self.now_mps = self.desired_mps.copy()
        self.limits_mps: dict[int, float] = {}
        self.ignored: dict[int, list[int]] = {}
        self.max_braking_mps2 = np.zeros(len(lines))
        self.heeds = np.repeat(np.transpose([careful if careful else [True] * len(lines)]), 2, axis=1)

    def position_m(self, vehicle, s_m):
        return np.append(self.lines[vehicle](s_m), 0.0)

    def ahead_m(self, vehicle, distance_m, left_m):
        if not len(vehicle):
            return np.zeros((*distance_m.shape, 3))
        s_m = self.s_m[vehicle, None] + distance_m
        points = np.stack([self.lines[v](s) for v, s in zip(vehicle, s_m, strict=True)])
        step = np.stack([self.lines[v](s + 0.01) for v, s in zip(vehicle, s_m, strict=True)]) - points
        ahead = step / np.linalg.norm(step, axis=-1, keepdims=True)
        left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
        return np.concatenate([points + left_m[..., None] * left, np.zeros((*distance_m.shape, 1))], axis=-1)

    def speed_mps(self, vehicle):
        return float(self.now_mps[vehicle])

    def limit_speed(self, vehicle, reason, speed_mps):
        self.limits_mps.pop(vehicle, None)
        if speed_mps is not None:
            self.limits_mps[vehicle] = speed_mps

    def ignore_at_junctions(self, vehicle, others):
        self.ignored[vehicle] = list(others)

    def drive(self, ticks=60, pedestrians=(), patience_s=np.inf, is_paved=None):
        """(T,) least distance of the first vehicle's middle to the others' and to people at (start, velocity)."""
        count = len(self.lines)
        size_m = np.array([CAR_M] * count + [PEDESTRIAN_M] * len(pedestrians))
        zeros = np.zeros(len(size_m))
        bodies = Bodies(
            point=np.arange(len(size_m)),
            trail_m=zeros + TRAIL_M,
            lead_m=zeros + LEAD_M,
            leans=zeros > 1.0,
            mount_m=np.zeros((len(size_m), 3)),
            contacts=ContactPoints(np.zeros(0, np.int64), np.zeros(0), np.zeros(0)),
            boxes=BodyBoxes(size_m, count),
        )
        behind_m = CAR_M[0] / 2.0 - LEAD_M
        fronts = np.array([self.position_m(v, s) for v, s in enumerate(self.s_m)])
        drivers = CarefulDrivers(bodies, self.heeds, fronts, self, TICK_S, patience_s, is_paved)
        distances_m, self.max_offset_m, self.max_back_m = [], 0.0, np.zeros(count)
        for tick in range(ticks):
            limit = np.array([self.limits_mps.get(v, np.inf) for v in range(count)])
            now_mps = np.minimum(np.minimum(limit, self.desired_mps), self.now_mps + 2.0 * TICK_S)
            self.max_braking_mps2 = np.maximum(self.max_braking_mps2, (self.now_mps - now_mps) / TICK_S)
            self.now_mps = now_mps
            self.s_m = self.s_m + now_mps * TICK_S
            front, point, rear = (
                np.array([self.position_m(v, s - back - drivers.back_m[v]) for v, s in enumerate(self.s_m)])
                + drivers.offset_m
                for back in (0.0, behind_m, behind_m + TRAIL_M)
            )
            ahead = (point - rear)[:, :2] / np.linalg.norm((point - rear)[:, :2], axis=1, keepdims=True)
            center = point - LEAD_M * np.column_stack([ahead, np.zeros(count)])
            walkers = np.array(
                [np.add(start, np.multiply(tick * TICK_S, velocity)) for start, velocity in pedestrians]
            ).reshape(-1, 2)
            positions = np.concatenate([center, np.column_stack([walkers, np.zeros(len(pedestrians))])])
            unmoved, on_sidewalk = np.zeros(len(positions), bool), np.zeros(len(pedestrians), bool)
            drivers.look_and_brake(front, point, rear, positions, ahead, unmoved[:count], unmoved, on_sidewalk)
            self.max_offset_m = max(self.max_offset_m, np.abs(drivers.offset_m).max())
            self.max_back_m = np.maximum(self.max_back_m, drivers.back_m)
            distances_m.append(np.linalg.norm(positions[1:] - positions[0], axis=1).min(initial=np.inf))
        return np.array(distances_m)


def test_on_crossing_paths_the_later_driver_yields_and_then_drives_on():
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -30.0], [10.0, 10.0])
    distances_m = traffic.drive(100)
    assert distances_m.min() > 3.3
    assert traffic.max_braking_mps2[0] == 0.0
    assert 2.0 < traffic.max_braking_mps2[1] <= 8.01
    assert (traffic.s_m > 20.0).all()


def test_a_careful_driver_brakes_for_a_reckless_one_that_does_not_brake():
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -30.0], [10.0, 10.0], careful=[True, False])
    traffic.drive()
    assert traffic.max_braking_mps2[1] == 0.0
    assert traffic.max_braking_mps2[0] > 2.0


@pytest.mark.parametrize("ignored", ["vehicles", "pedestrians"])
def test_a_driver_brakes_for_what_it_does_not_ignore(ignored):
    lines, pedestrian = [straight(0, 0, 0), straight(0, 0, 90)], ((0.0, -1.0), (0.0, 0.0))
    for others in ("vehicles", "pedestrians"):
        cars = slice(2 if others == "vehicles" else 1)
        traffic = LineTraffic(lines[cars], [-25.0, -30.0][cars], [10.0, 10.0][cars], careful=[True, False][cars])
        traffic.heeds[0] = [ignored != "vehicles", ignored != "pedestrians"]
        traffic.drive(pedestrians=(pedestrian,) if others == "pedestrians" else ())
        assert (traffic.max_braking_mps2[0] > 2.0) == (others != ignored)


def test_two_reckless_drivers_collide():
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -25.5], [10.0, 10.0], careful=[False, False])
    assert traffic.drive().min() < 1.0


def test_a_follower_brakes_for_a_slower_leader_that_does_not_brake():
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 0, 0)], [-25.0, 0.0], [14.0, 3.0])
    distances_m = traffic.drive()
    assert distances_m.min() > CAR_M[0]
    assert traffic.max_braking_mps2[0] > 2.0
    assert traffic.max_braking_mps2[1] == 0.0


def test_no_driver_brakes_for_oncoming_traffic_in_a_bend():
    traffic = LineTraffic([bend(21.75, 1.0), bend(18.25, -1.0)], [-40.0, -60.0], [11.0, 11.0])
    traffic.drive()
    assert (traffic.max_braking_mps2 == 0.0).all()
    assert traffic.max_offset_m == 0.0


def test_drivers_who_pass_narrowly_move_aside_instead_of_braking():
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 2.1, 180)], [-30.0, -30.0], [6.0, 6.0])
    traffic.drive()
    assert (traffic.max_braking_mps2 == 0.0).all()
    assert 0.05 < traffic.max_offset_m < 0.4


@pytest.mark.parametrize(("clear_m", "room_m"), [(0.05, 0.0), (0.35, 0.3), (1.0, 0.5)])
def test_drivers_move_aside_only_as_far_as_they_stay_on_the_pavement(clear_m, room_m):
    gap_m = CAR_M[1] - 0.4  # each has to move by a little more than 0.2 m, and more if the other one does not

    def is_paved(points_m):
        return np.abs(points_m[:, 1] - gap_m / 2.0) < gap_m / 2.0 + CAR_M[1] / 2.0 + clear_m

    traffic = LineTraffic([straight(0, 0, 0), straight(0, gap_m, 180)], [-30.0, -30.0], [6.0, 6.0])
    traffic.drive(is_paved=is_paved)
    assert traffic.max_offset_m <= room_m + 1e-9
    assert traffic.max_offset_m >= room_m - 0.2


@pytest.mark.parametrize(("start_m", "velocity_mps", "brakes"), [((0, -4), (0, 1.4), True), ((0, 4), (0, 0), False)])
def test_drivers_brake_for_pedestrians_ahead_but_not_for_those_standing_beside_the_lane(start_m, velocity_mps, brakes):
    traffic = LineTraffic([straight(0, 0, 0)], [-25.0], [9.0])
    distances_m = traffic.drive(pedestrians=[(start_m, velocity_mps)])
    assert (traffic.max_braking_mps2[0] > 2.0) == brakes
    assert distances_m.min() > 1.3


@pytest.mark.parametrize(("patience_s", "passes"), [(np.inf, False), (4.0, True)])
def test_a_driver_who_has_waited_for_long_passes_narrowly_between_vehicles_that_stand(patience_s, passes):
    gate = [straight(0, side * (CAR_M[1] + 0.06), 0) for side in (1.0, -1.0)]
    traffic = LineTraffic([straight(0, 0, 0), *gate], [-25.0, 0.0, 0.0], [6.0, 0.0, 0.0])
    traffic.drive(200, patience_s=patience_s)
    assert (traffic.s_m[0] > 5.0) == passes
    assert traffic.max_offset_m < 0.06


@pytest.mark.parametrize(("patience_s", "creeps"), [(np.inf, False), (4.0, True)])
def test_a_driver_who_has_waited_for_long_creeps_towards_a_pedestrian_who_stands(patience_s, creeps):
    traffic = LineTraffic([straight(0, 0, 0)], [-25.0], [6.0])
    traffic.drive(80, [((0, 0), (0, 0))], patience_s)
    halted_m = float(traffic.s_m[0])
    traffic.drive(1, [((0, 0), (0, 0))], patience_s)
    assert (traffic.now_mps[0] > 0.3) == creeps
    assert traffic.now_mps[0] <= 0.4 + 1e-9
    assert halted_m < 0.0


@pytest.mark.parametrize(
    ("patience_s", "behind_m", "careful", "passes"),
    [(np.inf, 20.0, True, False), (4.0, 20.0, True, True), (4.0, 5.0, True, True), (4.0, 5.0, False, False)],
)
def test_drivers_who_stand_in_the_way_back_off_with_those_behind_if_these_are_careful(
    patience_s, behind_m, careful, passes
):
    across = straight(0, -CAR_M[1] / 2.0, 90)
    lines, start_m = [straight(0, 0, 0), across, across], [-25.0, 0.8, 0.8 - behind_m]
    traffic = LineTraffic(lines, start_m, [6.0, 0.0, 0.0], careful=[True, True, careful])
    distances_m = traffic.drive(300, patience_s=patience_s)
    assert (traffic.s_m[0] > 5.0) == passes
    assert distances_m.min() > CAR_M[1] / 2.0
    assert (traffic.max_back_m > 0.0).tolist() == [
        False,
        np.isfinite(patience_s) and (careful or passes),
        passes and behind_m < 6.0,
    ]
    assert traffic.max_back_m.max() <= 4.0
    assert 0 not in traffic.ignored or passes != bool(traffic.ignored[0])


@pytest.mark.parametrize(("patience_s", "passes"), [(np.inf, False), (4.0, True)])
def test_one_of_two_drivers_who_stand_in_each_others_way_backs_off(patience_s, passes):
    traffic = LineTraffic([straight(0, 0, 0), straight(0, 0, 90)], [0.4, 0.4], [6.0, 6.0])
    traffic.now_mps[:] = 0.0
    distances_m = traffic.drive(400, patience_s=patience_s)
    assert ((traffic.s_m > 5.0) == passes).all()
    assert (traffic.max_back_m > 0.0).tolist() == [passes, False]
    assert distances_m.min() > 2.6


@pytest.mark.parametrize(("patience_s", "min_gap_m", "max_gap_m"), [(np.inf, 0.7, 1.5), (4.0, 0.1, 0.6)])
def test_a_driver_who_has_waited_for_long_creeps_up_to_a_vehicle_that_stays(patience_s, min_gap_m, max_gap_m):
    across = straight(5.0 + CAR_M[1] / 2.0, 0.0, 90)  # its side is at 5 m
    traffic = LineTraffic([straight(0, 0, 0), across], [-5.0, CAR_M[0] / 2.0], [6.0, 0.0])
    traffic.heeds[1] = False
    traffic.drive(250, patience_s=patience_s)
    assert min_gap_m < 5.0 - traffic.s_m[0] < max_gap_m
    assert traffic.now_mps[0] == 0.0


@pytest.mark.parametrize(("patience_s", "passes"), [(np.inf, False), (4.0, True)])
def test_a_driver_who_has_stood_for_long_passes_those_near_who_have_until_it_has_driven_past(patience_s, passes):
    """The third vehicle is far away, and the fourth one moves."""
    traffic = LineTraffic([straight(0, 0, 0)] * 4, [0.0] * 4, [0.0] * 4)
    drivers = BackingOff(4, traffic, TICK_S, patience_s)
    position_m = np.array([[0.0, 0.0], [6.0, 6.0], [60.0, 6.0], [-12.0, 6.0]])
    for speed_mps, seconds, ignored in ((0.0, 3.9, {}), (0.0, 0.3, {0: [1], 1: [0]}), (2.0, 7.0, {0: [1], 1: []})):
        for _ in range(round(seconds / TICK_S)):
            drivers.pass_standing(np.array([speed_mps, 0.0, 0.0, 0.1]), position_m)
        assert traffic.ignored == (ignored if passes else {})
    for _ in range(10):
        drivers.pass_standing(np.array([2.0, 0.0, 0.0, 0.1]), position_m)
    assert traffic.ignored.get(0, []) == []
