"""The drives of recorded scenes: their infractions and figures as the referee published them, or judged again."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from simbev_ros.dataset import Scene
from simbev_ros.evaluation.driving.figures import checked_figures, drive_figures
from simbev_ros.evaluation.driving.infractions import Infraction
from simbev_ros.evaluation.driving.referee import Referee
from simbev_ros.evaluation.driving.static_world import load_static_world
from simbev_ros.foundation.errors import BagError
from simbev_ros.maps.build import load_network
from simbev_ros.schema.scene.state import COLLISION, EGO_ID, ENTITY_PREFIX, WorldState

_EVENTS, _SCORE, _ACTORS, _SIGNALS = "drive/events", "drive/score", "world/actors", "world/signals"


@dataclass(frozen=True, slots=True)
class RecordedDrive:
    """A drive.

    Attributes:
        scene: Name of the scene.
        figures: Scores and what they are made of, see ``figures.drive_figures``.
        infractions: All infractions in order.
        route_events: Records of /world/events for begin and end of each event along the route.
    """

    scene: str
    figures: Mapping[str, Any]
    infractions: tuple[Infraction, ...]
    route_events: tuple[Mapping[str, Any], ...] = ()

    def record(self) -> dict[str, Any]:
        """The drive as plain values for JSON, without the name of the scene."""
        events = [infraction.record() for infraction in self.infractions]
        return {**self.figures, "events": events, "route_events": self.route_events}


def drives_of(scenes: Sequence[Scene], *, again: bool = False) -> list[RecordedDrive]:
    """The drives of the scenes that have one; judged ``again``, or where the last tick has no recorded score.

    Raises:
        BagError: A bag is damaged.
    """
    driven = [scene for scene in scenes if scene.spec.drive is not None]
    return [_as_recorded(scene) if not again and _has_last_score(scene) else judge_again(scene) for scene in driven]


def judge_again(scene: Scene) -> RecordedDrive:
    """Judge a recorded drive from the true states in the bag, up to the last one: also of a scene that was cut short.

    Raises:
        BagError: The bag is damaged.
    """
    network = load_network(scene.spec.map)
    referee = Referee(scene.spec, network, load_static_world(scene.spec, network))
    for state in _states(scene):
        referee.judge(state)
    drive = referee.record
    return RecordedDrive(scene.name, drive_figures(drive), drive.infractions, _route_events(scene))


def _states(scene: Scene) -> Iterator[WorldState]:
    for frame in scene:
        if _ACTORS in frame and _SIGNALS in frame:
            tick = scene.spec.tick_of(frame.stamp_ns)
            yield WorldState(frame.stamp_ns, tick, EGO_ID, frame[_ACTORS], frame[_SIGNALS], scene.weather)


def _has_last_score(scene: Scene) -> bool:
    return len(scene) > 0 and bool(scene.has([_SCORE])[-1])


def _as_recorded(scene: Scene) -> RecordedDrive:
    try:
        infractions = tuple(map(Infraction.of_record, scene.records(_EVENTS)))
        return RecordedDrive(scene.name, checked_figures(scene[-1][_SCORE]), infractions, _route_events(scene))
    except ValueError as error:
        raise BagError(f"{scene.path}: /drive: {error}") from None


def _route_events(scene: Scene) -> tuple[Mapping[str, Any], ...]:
    events = ((str(each.get("type")), each) for each in scene.records("world/events"))
    return tuple(each for kind, each in events if kind != COLLISION and not kind.startswith(ENTITY_PREFIX))
