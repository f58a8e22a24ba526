"""Storyboards written as Python, and a stage on a straight road on which they run without a world."""

import math
import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from simbev_ros.foundation.geometry.geodesy import MapDatum
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.opendrive.lane_places import Roads
from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.bodies import Body, Mover
from simbev_ros.scene.storyboard.model import Element
from simbev_ros.scene.storyboard.positions import Positions
from simbev_ros.simulation.world.storyboard.stage import Stage
from simbev_ros.simulation.world.storyboard.storyboard import Storyboard

TICK_NS = 50_000_000
CAR_M, CAR_CENTER_M = (4.0, 2.0, 1.5), (1.4, 0.0)
PERSON_M = (0.5, 0.6, 1.8)
LANE_M = 3.5
Y_RIGHT, Y_FAR_RIGHT, Y_LEFT = -1.75, -5.25, 1.75
"""Center lines of the lanes -1, -2 and 1 of the straight road along x."""


_LANE = '<lane id="{}" type="driving"><link/><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
_ROAD = """<?xml version="1.0"?>
<OpenDRIVE><header revMajor="1" revMinor="4"/><road id="1" length="{length}" junction="-1"><link/>
<planView><geometry s="0" x="0" y="0" hdg="0" length="{length}"><line/></geometry></planView>
<lanes><laneSection s="0"><left>{left}</left><center><lane id="0" type="none"/></center><right>{right}</right>
</laneSection></lanes></road></OpenDRIVE>
"""


def straight(folder: Path, length_m: float = 2000.0) -> Path:
    """A straight road from (0, 0) along x with two lanes to the right and one to the left."""
    path = folder / "straight.xodr"
    right = _LANE.format(-1) + _LANE.format(-2)
    path.write_text(_ROAD.format(length=length_m, left=_LANE.format(1), right=right))
    return path


def narrowing(folder: Path) -> Path:
    """The straight road, on which lane -2 ends after 100 m."""
    path = straight(folder)
    head, section, tail = re.split(r"(<laneSection.*</laneSection>)", path.read_text(), flags=re.DOTALL)
    path.write_text(head + section + section.replace('s="0"', 's="100"').replace(_LANE.format(-2), "") + tail)
    return path


class Show:
    """A storyboard on its stage."""

    def __init__(self, road: Path, bodies: Iterable[Body], storyboard: Element, values: dict[str, str] | None = None):
        by_name = {body.name: body for body in bodies}
        mover = Mover(Roads(road))
        self.stage = Stage(mover, Positions(mover, by_name, MapDatum(48.0, 9.0, 0.0)), by_name, TICK_NS / NS_PER_S)
        self.stage.values = values or {}
        self.storyboard = Storyboard(storyboard, self.stage)
        self.log: list[tuple[float, str, str]] = []
        self.tick = 0
        self.storyboard.initialize()
        self._advance()

    def _advance(self) -> None:
        self.storyboard.advance()
        self.log += [
            (self.stage.time_s, change.removesuffix("Transition"), part.path.rsplit("/", 1)[-1])
            for change, part in self.storyboard.changes
        ]

    def run_to(self, time_s: float) -> None:
        """Run up to a time."""
        while self.tick * TICK_NS < round(time_s * NS_PER_S):
            self.tick += 1
            self.stage.move_bodies(self.tick * TICK_NS / NS_PER_S)
            self._advance()

    def __getitem__(self, name: str) -> Body:
        return self.stage.bodies[name]

    def xy(self, name: str) -> tuple[float, float]:
        """Position of an entity."""
        x_m, y_m, _ = self[name].position_m.tolist()
        return x_m, y_m

    def times(self, change: str, name: str) -> list[float]:
        """Times of the transitions of an element."""
        return [time_s for time_s, each, part in self.log if (each, part) == (change, name)]


def car(name: str) -> Body:
    return Body(name, CAR_M, CAR_CENTER_M)


def person(name: str) -> Body:
    return Body(name, PERSON_M, kind="pedestrian")


def trigger(
    *tests: Element, edge: str = "none", delay_s: float = 0.0, who: Sequence[str] = (), rule: str = "any"
) -> Element:
    """A trigger of one group of conditions."""
    entities = tuple(model.EntityRef(entity_ref=name) for name in who)
    triggering = model.TriggeringEntities(triggering_entities_rule=rule, entities=entities) if who else None
    conditions = [
        model.Condition(name="c", delay_s=delay_s, condition_edge=edge, triggering_entities=triggering, test=test)
        for test in tests
    ]
    return model.Trigger(groups=(model.ConditionGroup(conditions=tuple(conditions)),))


def after(time_s: float) -> Element:
    return trigger(model.SimulationTimeCondition(value_s=time_s, rule="greaterOrEqual"))


def dynamics(shape: str = "step", dimension: str = "time", value: float = 0.0) -> Element:
    return model.TransitionDynamics(dynamics_shape=shape, dynamics_dimension=dimension, value=value)


def speed(target_mps: float, *how: Any) -> Element:
    return model.SpeedAction(dynamics=dynamics(*how), target=model.AbsoluteTargetSpeed(value_mps=target_mps))


def lane(s_m: float, lane_id: int = -1, offset_m: float = 0.0, h_rad: float | None = None, road: str = "1") -> Element:
    turned = None if h_rad is None else model.Orientation(type="relative", h_rad=h_rad)
    return model.LanePosition(road_id=road, lane_id=lane_id, s_m=s_m, offset_m=offset_m, orientation=turned)


def world(x_m: float, y_m: float, h_rad: float = 0.0) -> Element:
    return model.WorldPosition(x_m=x_m, y_m=y_m, h_rad=h_rad)


def placed(name: str, position: Element, speed_mps: float = 0.0) -> Element:
    """The actions of ``Init`` for an entity."""
    actions = (model.TeleportAction(position=position), speed(speed_mps))
    return model.Private(entity_ref=name, actions=actions)


def event(name: str, start: Element | None, *parts: Element, priority: str = "override", times: int = 1) -> Element:
    actions = tuple(model.Action(name=f"{name}-{k}", parts=(part,)) for k, part in enumerate(parts))
    return model.Event(
        name=name, priority=priority, maximum_execution_count=times, actions=actions, start_trigger=start
    )


def story(
    actors: Sequence[str],
    *events: Element,
    start: Element | None = None,
    stop: Element | None = None,
    times: int = 1,
    triggering: bool = False,
) -> Element:
    """A story of one act, maneuver group and maneuver."""
    who = model.Actors(
        select_triggering_entities=triggering, entities=tuple(model.EntityRef(entity_ref=name) for name in actors)
    )
    maneuver = model.Maneuver(name="maneuver", events=events)
    group = model.ManeuverGroup(name="group", maximum_execution_count=times, actors=who, maneuvers=(maneuver,))
    act = model.Act(name="act", maneuver_groups=(group,), start_trigger=start, stop_trigger=stop)
    return model.Story(name="story", acts=(act,))


def storyboard(*parts: Element, stop: Element | None = None, first: Sequence[Element] = ()) -> Element:
    """A storyboard of what is placed, and of stories; ``first`` are the global actions of ``Init``."""
    privates = tuple(part for part in parts if part.kind == "Private")
    stories = tuple(part for part in parts if part.kind == "Story")
    init = model.Init(global_actions=tuple(first), privates=privates)
    return model.Storyboard(init=init, stories=stories, stop_trigger=stop)


def polyline(*points: tuple[float, float], times_s: Sequence[float | None] | None = None) -> Element:
    vertices = tuple(
        model.Vertex(time_s=time_s, position=world(*point))
        for point, time_s in zip(points, times_s or [None] * len(points), strict=True)
    )
    return model.Trajectory(name="line", closed=False, shape=model.Polyline(vertices=vertices))


def follow(trajectory: Element, timing: Element | None = None) -> Element:
    mode = model.TrajectoryFollowingMode(following_mode="position")
    return model.FollowTrajectoryAction(trajectory=trajectory, timing=timing, mode=mode)


def kmh(value: float) -> float:
    return value / 3.6


def rest_after(v_mps: float, decel_mps2: float) -> Callable[[float], float]:
    """Distance over time of a car that brakes to rest: v t - a t² / 2 up to v / a."""
    return lambda t: v_mps * min(t, v_mps / decel_mps2) - decel_mps2 * min(t, v_mps / decel_mps2) ** 2 / 2.0


def sinusoid(u: float) -> float:
    """The sinusoidal shape."""
    return (1.0 - math.cos(math.pi * min(max(u, 0.0), 1.0))) / 2.0
