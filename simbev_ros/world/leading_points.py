"""The points that bodies follow: SUMO's places, kept from jumping, and clear of what SUMO does not know.

Vehicles are towed after their fronts and drive aside where it is narrow; people leave SUMO's net, walk around things
and keep off vehicles. Whoever drives looks out where all these points lead. All is at SUMO's moment.
"""

from dataclasses import replace

import numpy as np

from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.types import BoolArray, Float64Array, Table
from simbev_ros.world.driving.careful_drivers import Lookout
from simbev_ros.world.kinematics.collisions import Collisions
from simbev_ros.world.kinematics.followers import Pursuit, Steady, Tow
from simbev_ros.world.kinematics.ground import Ground
from simbev_ros.world.kinematics.motion import Bodies
from simbev_ros.world.pedestrians.excursions import Excursions
from simbev_ros.world.pedestrians.furniture_avoidance import Furniture
from simbev_ros.world.pedestrians.vehicle_avoidance import Berth
from simbev_ros.world.population import Population
from simbev_ros.world.sumo.traffic import TrafficSample

_MOST_CHANGE_MPS2 = 20.0  # more, before averaging, is a jump of SUMO's between lanes that do not meet, and no driving
_WALKERS_MPS2 = 4.0
_HURRY = 1.3  # highest speed of a pedestrian that makes up for a sideways jump of SUMO's, over its usual highest
_STEP_BACK_MPS = 1.0  # of who would be touched by a vehicle, over that


class LeadingPoints:
    """Those of a scene's V vehicles, then of its P people.

    Attributes:
        now: (V + P, 4) the latest points, map frame, and how high above them the bodies stand.
    """

    def __init__(
        self,
        spec: SceneSpec,
        traffic: Population,
        bodies: Bodies,
        excursions: Excursions,
        ground: Ground,
        obstacles: Table,
        sample: TrafficSample,
        directions: Float64Array,
    ) -> None:
        """At rest.

        Args:
            spec: The scene.
            traffic: SUMO.
            bodies: What follows the points.
            excursions: People off SUMO's net.
            ground: What everybody stands on.
            obstacles: (K,) ``OBSTACLE_DTYPE``, what people walk around.
            sample: Where everybody starts.
            directions: (V + P, 3) unit vectors in which they look.
        """
        tick_s = spec.tick_ns / NS_PER_S
        vehicles = len(sample.front_m)
        fastest_mps = np.array([spec.pedestrians[index].max_speed_mps for index in traffic.pedestrians])
        self._tick_s = tick_s
        self._sumos = slice(traffic.moving)
        self._excursions, self._ground, self._furniture = excursions, ground, Furniture(obstacles)
        self._steady = Steady(sample.front_m, _MOST_CHANGE_MPS2 * tick_s**2)
        behind_m = (bodies.boxes.size_m[:vehicles, 0] / 2.0 - bodies.lead_m[:vehicles])[:, None]
        self._tow = Tow(sample.front_m, directions[:vehicles], behind_m[:, 0])
        self._berth = Berth(bodies, sample.front_m - behind_m * directions[:vehicles], directions[:vehicles])
        self._lookout = Lookout(bodies, _careful(spec, traffic), sample.front_m[self._sumos], traffic, tick_s)
        start_m = self._furniture.aside(sample.pedestrian_m)
        self._pursuit = Pursuit(start_m, _HURRY * fastest_mps * tick_s, _WALKERS_MPS2 * tick_s**2)
        self._step_back_m = (_HURRY * fastest_mps + _STEP_BACK_MPS) * tick_s
        self._wrecks = np.zeros(0, np.int64), np.zeros((0, 3)), np.zeros(0)
        self.now: Float64Array = self._led(sample)

    def advance(self, sample: TrafficSample, crashed: BoolArray) -> None:
        """Take SUMO's next sample; (V + P,) who has had a collision and goes nowhere any more."""
        vehicles = len(sample.front_m)
        pedestrian_m = self._excursions.advance(sample, crashed[vehicles:])
        self.now = self._led(replace(sample, pedestrian_m=pedestrian_m))
        self._lookout.advance(
            self._front_m[self._sumos],
            self.now[self._sumos, :3],
            self._berth.rear_m[self._sumos],
            np.concatenate([self._berth.center_m, self.now[vehicles:, :3]]),
            self._berth.ahead,
            crashed,
            self.now[vehicles:, 3] != 0.0,
        )

    def rest(self, collisions: Collisions) -> None:
        """Let bodies that have had collisions be where they come to rest, not where their points are."""
        vehicles = len(self._berth.center_m)
        wrecks = np.flatnonzero(collisions.crashed[:vehicles])
        self._step_back_m[collisions.crashed[vehicles:]] = 0.0
        self._wrecks = wrecks, collisions.rest_m[wrecks], collisions.yaw_rad[wrecks]

    def _led(self, sample: TrafficSample) -> Float64Array:
        """(V + P, 4) points one tick on.

        People on sidewalks stand on the curb, those on plazas on the paving, all else on the carriageway.
        """
        self._front_m = self._steady.advance(sample.front_m).copy()
        self._front_m[self._sumos] += self._lookout.aside_m
        point_m = self._tow.advance(self._front_m)
        wanted_m = self._furniture.aside(sample.pedestrian_m)
        wanted_m = self._berth.advance(point_m, self._pursuit.position_m, wanted_m, self._tick_s)
        self._berth.rest(*self._wrecks)
        pedestrian_m = self._berth.keep_off(self._pursuit.advance(wanted_m), self._step_back_m)
        self._pursuit.position_m = pedestrian_m
        points = np.zeros((len(point_m) + len(pedestrian_m), 4))
        points[:, :3] = np.concatenate([point_m, pedestrian_m])
        points[len(point_m) :, 3] = self._raised_m(pedestrian_m)
        return points

    def _raised_m(self, pedestrian_m: Float64Array) -> Float64Array:
        """(P,) how high above the carriageway's plane people at (P, 3) places stand."""
        raised_m = self._ground.raised_m(pedestrian_m)
        paving_m = self._excursions.paving_m(pedestrian_m)
        paved = np.flatnonzero((raised_m == 0.0) & np.isfinite(paving_m))
        raised_m[paved] = paving_m[paved] - self._ground.heights_m(pedestrian_m[paved])
        return raised_m


def _careful(spec: SceneSpec, traffic: Population) -> BoolArray:
    """(V,) whose drivers look out; an ego that is driven from outside does so itself."""
    driven = {0} if spec.ego_driver == "twist" else set()
    return np.array([not spec.vehicles[index].reckless and index not in driven for index in traffic.vehicles])
