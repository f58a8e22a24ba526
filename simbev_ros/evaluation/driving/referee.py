"""The referee: judges the drive of a scene's first agent, state by state, live as well as from a recording."""

from collections.abc import Iterator
from itertools import chain

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.infractions import Infraction, InfractionKind
from simbev_ros.evaluation.driving.moment import Moment, Rule
from simbev_ros.evaluation.driving.motion import ComfortRule
from simbev_ros.evaluation.driving.rules.collisions import CollisionRule, Obstacles
from simbev_ros.evaluation.driving.rules.lanes import LaneRule, RoadPlaces
from simbev_ros.evaluation.driving.rules.pace import ScenarioRule, SpeedRule
from simbev_ros.evaluation.driving.rules.right_of_way import RedLightRule, StopSignRule, YieldRule
from simbev_ros.evaluation.driving.rules.time_to_collision import TimeToCollisionRule
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.schema.scene.route_progress import DriveEnd, DriveRule
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState


class Referee:
    """Judges one drive. It knows the truth and nothing of the driver.

    Args:
        spec: The scene, with a drive.
        network: Its roads.
        obstacles: Its static world; None: collisions with it are not seen.

    Raises:
        InputError: The scene has no drive.
    """

    def __init__(self, spec: SceneSpec, network: RoadNetwork, obstacles: Obstacles | None = None) -> None:
        if spec.drive is None:
            raise InputError(f"{spec.name}: has no route to drive")
        self._tick_s = spec.tick_ns / NS_PER_S
        self._ending, self._ended, self._completed = DriveRule(spec.drive, spec.tick_ns), "", 0.0
        places = RoadPlaces(network)
        self._lanes, self._speed, self._comfort = (
            LaneRule(places),
            SpeedRule(spec, spec.drive),
            ComfortRule(self._tick_s),
        )
        self._time_to_collision = TimeToCollisionRule(places)
        self._rules: tuple[Rule, ...] = (
            CollisionRule(places, obstacles),
            RedLightRule(network),
            StopSignRule(network),
            YieldRule(spec),
            self._lanes,
            self._speed,
            ScenarioRule(spec.drive),
            self._time_to_collision,
            self._comfort,
        )
        self._infractions: list[Infraction] = []
        self._before: Moment | None = None
        self._ticks = 0

    def judge(self, state: WorldState) -> tuple[Infraction, ...]:
        """Judge the next recorded tick; returns the infractions that begin. What follows the end of a drive is free."""
        if state.tick < 0 or self._ended:
            return ()
        if self._before is not None and self._before.before is not None:
            self._before.before.before = None  # two moments are enough
        moment = Moment(state, self._tick_s, self._before, 0.0)
        end = self._ending.end_at(state.tick, moment.position_m, moment.speed_mps)
        progress = self._ending.progress
        moment.distance_m, self._completed = progress.furthest_m, progress.completed
        found = (*chain.from_iterable(rule.judge(moment) for rule in self._rules), *self._end(moment, end))
        self._infractions += found
        self._before, self._ticks = moment, self._ticks + 1
        return found

    def _end(self, moment: Moment, end: tuple[DriveEnd, str] | None) -> Iterator[Infraction]:
        """Yield what ends the drive, unless it is the goal."""
        if end is not None:
            self._ended = end[0].value
            if end[0] is DriveEnd.GOAL:
                self._completed = 1.0
            else:
                yield moment.infraction(InfractionKind(end[0].value), moment.distance_m)

    @property
    def ended(self) -> str:
        """Why the drive is over; "" while it goes on."""
        return self._ended

    @property
    def record(self) -> DriveRecord:
        """The drive up to the latest tick."""
        lanes = self._lanes
        return DriveRecord(
            infractions=tuple(self._infractions),
            completed=self._completed,
            ended=self._ended,
            tick_s=self._tick_s,
            ticks=self._ticks,
            driven_m=lanes.driven_m,
            outside_m=lanes.outside_m,
            overspeed_m=lanes.overspeed_m,
            max_off_road_m=lanes.max_off_road_m,
            max_oncoming_m=lanes.max_oncoming_m,
            min_time_to_collision_s=self._time_to_collision.min_s,
            speed_checks=tuple(self._speed.checks),
            comfort=self._comfort.variables(),
        )
