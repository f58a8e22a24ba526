"""Who brakes for whom, with a traffic that is made up: each vehicle drives along a line that is given."""

from collections.abc import Callable

import numpy as np
import pytest

from simbev_ros.world.driving.careful_drivers import Lookout
from simbev_ros.world.kinematics.contacts import Boxes
from simbev_ros.world.kinematics.footing import Contacts
from simbev_ros.world.kinematics.motion import Bodies

TICK_S = 0.1
CAR_M, PERSON_M = (4.6, 2.0, 1.5), (0.6, 0.5, 1.7)
TRAIL_M, LEAD_M = 2.8, 1.4
Line = Callable[[np.ndarray], np.ndarray]


def straight(x_m: float, y_m: float, yaw_deg: float) -> Line:
    """Through a place, at a heading."""
    ahead = np.array([np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))])
    return lambda s_m: np.array([x_m, y_m]) + np.asarray(s_m)[..., None] * ahead


def bend(radius_m: float, sign: float) -> Line:
    """Along the x axis to 0, and then around a bend to the left; a negative sign: the same road back."""

    def line(s_m: np.ndarray) -> np.ndarray:
        s_m = sign * np.asarray(s_m, float)
        turn = np.clip(s_m / 20.0, 0.0, np.pi / 2.0)
        arc_m = np.stack([radius_m * np.sin(turn), 20.0 - radius_m * np.cos(turn)], axis=-1)
        past_m = np.maximum(s_m - 10.0 * np.pi, 0.0)
        return arc_m + np.stack([np.minimum(s_m, 0.0), past_m], axis=-1)

    return line


class Road:
    """Vehicles on lines, which drive at a speed of their own unless they are limited."""

    def __init__(
        self, lines: list[Line], start_m: list[float], speed_mps: list[float], careful: list[bool] | None = None
    ):
        self.lines, self.s_m, self.wanted_mps = lines, np.array(start_m), np.array(speed_mps)
        self.now_mps = self.wanted_mps.copy()
        self.limits_mps: dict[int, float] = {}
        self.hardest_mps2 = np.zeros(len(lines))
        self.careful = np.array(careful if careful else [True] * len(lines))

    def places_m(self, vehicle, s_m):
        return np.append(self.lines[vehicle](s_m), 0.0)

    def ahead_m(self, vehicle, way_m, left_m):
        s_m = self.s_m[vehicle, None] + way_m
        here = np.stack([self.lines[v](s) for v, s in zip(vehicle, s_m, strict=True)])
        step = np.stack([self.lines[v](s + 0.01) for v, s in zip(vehicle, s_m, strict=True)]) - here
        ahead = step / np.linalg.norm(step, axis=-1, keepdims=True)
        left = np.stack([-ahead[..., 1], ahead[..., 0]], axis=-1)
        return np.concatenate([here + left_m[..., None] * left, np.zeros((*way_m.shape, 1))], axis=-1)

    def speed_mps(self, vehicle):
        return float(self.now_mps[vehicle])

    def limit(self, vehicle, reason, speed_mps):
        self.limits_mps.pop(vehicle, None)
        if speed_mps is not None:
            self.limits_mps[vehicle] = speed_mps

    def drive(self, ticks=60, people=()):
        """(T,) least distance of the first vehicle's middle to the others' and to people at (start, velocity)."""
        count = len(self.lines)
        size_m = np.array([CAR_M] * count + [PERSON_M] * len(people))
        zeros = np.zeros(len(size_m))
        bodies = Bodies(
            point=np.arange(len(size_m)),
            trail_m=zeros + TRAIL_M,
            lead_m=zeros + LEAD_M,
            leans=zeros > 1.0,
            mount_m=np.zeros((len(size_m), 3)),
            contacts=Contacts(np.zeros(0, np.int64), np.zeros(0), np.zeros(0)),
            boxes=Boxes(size_m, count),
        )
        behind_m = CAR_M[0] / 2.0 - LEAD_M
        fronts = np.array([self.places_m(v, s) for v, s in enumerate(self.s_m)])
        lookout = Lookout(bodies, self.careful, fronts, self, TICK_S)
        gaps_m, self.aside_m = [], 0.0
        for tick in range(ticks):
            limit = np.array([self.limits_mps.get(v, np.inf) for v in range(count)])
            now_mps = np.minimum(np.minimum(limit, self.wanted_mps), self.now_mps + 2.0 * TICK_S)
            self.hardest_mps2 = np.maximum(self.hardest_mps2, (self.now_mps - now_mps) / TICK_S)
            self.now_mps = now_mps
            self.s_m = self.s_m + now_mps * TICK_S
            front, point, rear = (
                np.array([self.places_m(v, s - back) for v, s in enumerate(self.s_m)]) + lookout.aside_m
                for back in (0.0, behind_m, behind_m + TRAIL_M)
            )
            ahead = (point - rear)[:, :2] / np.linalg.norm((point - rear)[:, :2], axis=1, keepdims=True)
            center = point - LEAD_M * np.column_stack([ahead, np.zeros(count)])
            walkers = np.array([np.add(start, np.multiply(tick * TICK_S, pace)) for start, pace in people]).reshape(
                -1, 2
            )
            places = np.concatenate([center, np.column_stack([walkers, np.zeros(len(people))])])
            still, kerb = np.zeros(len(places), bool), np.zeros(len(people), bool)
            lookout.advance(front, point, rear, places, ahead, still, kerb)
            self.aside_m = max(self.aside_m, np.abs(lookout.aside_m).max())
            gaps_m.append(np.linalg.norm(places[1:] - places[0], axis=1).min(initial=np.inf))
        return np.array(gaps_m)


def test_of_two_whose_paths_cross_the_later_one_lets_the_other_pass_and_goes_on():
    road = Road([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -30.0], [10.0, 10.0])
    gaps_m = road.drive(100)
    assert gaps_m.min() > 3.3
    assert road.hardest_mps2[0] == 0.0
    assert 2.0 < road.hardest_mps2[1] <= 8.01
    assert (road.s_m > 20.0).all()


def test_a_reckless_driver_brakes_for_nobody_and_the_other_one_does():
    road = Road([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -30.0], [10.0, 10.0], careful=[True, False])
    road.drive()
    assert road.hardest_mps2[1] == 0.0
    assert road.hardest_mps2[0] > 2.0


def test_two_reckless_drivers_collide():
    road = Road([straight(0, 0, 0), straight(0, 0, 90)], [-25.0, -25.5], [10.0, 10.0], careful=[False, False])
    assert road.drive().min() < 1.0


def test_who_follows_brakes_for_a_slower_one_and_is_not_braked_for():
    road = Road([straight(0, 0, 0), straight(0, 0, 0)], [-25.0, 0.0], [14.0, 3.0])
    gaps_m = road.drive()
    assert gaps_m.min() > CAR_M[0]
    assert road.hardest_mps2[0] > 2.0
    assert road.hardest_mps2[1] == 0.0


def test_nobody_brakes_for_oncoming_traffic_in_a_bend():
    road = Road([bend(21.75, 1.0), bend(18.25, -1.0)], [-40.0, -60.0], [11.0, 11.0])
    road.drive()
    assert (road.hardest_mps2 == 0.0).all()
    assert road.aside_m == 0.0


def test_who_passes_another_narrowly_moves_aside_instead_of_braking():
    road = Road([straight(0, 0, 0), straight(0, 2.1, 180)], [-30.0, -30.0], [6.0, 6.0])
    road.drive()
    assert (road.hardest_mps2 == 0.0).all()
    assert 0.05 < road.aside_m < 0.4


@pytest.mark.parametrize(("start_m", "pace_mps", "brakes"), [((0, -4), (0, 1.4), True), ((0, 4), (0, 0), False)])
def test_drivers_brake_for_people_before_them_and_for_nobody_who_stands_beside(start_m, pace_mps, brakes):
    road = Road([straight(0, 0, 0)], [-25.0], [9.0])
    gaps_m = road.drive(people=[(start_m, pace_mps)])
    assert (road.hardest_mps2[0] > 2.0) == brakes
    assert gaps_m.min() > 1.3
