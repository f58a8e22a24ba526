"""Replaying a recorded scene: its actors and signals once more, tick by tick, with another rig or another weather."""

import gzip
import json
import tempfile
import zlib
from collections import defaultdict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from simbev_ros.config.scenario import Scenario
from simbev_ros.errors import BagError, InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.layout import (
    LEAD_IN_ATTACHMENT,
    MAP_ATTACHMENT,
    MAP_SOURCE_ATTACHMENT,
    SCENE_ATTACHMENT,
)
from simbev_ros.recording.lead_in import lead_in_messages
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.scene.drawing.draw_lights import draw_lights
from simbev_ros.scene.drawing.draw_weather import draw_weathers
from simbev_ros.scene.drawing.starts import Starts
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, Event, Light, WorldState
from simbev_ros.types import Table
from simbev_ros.world.lights import needs_low_beam

_TABLES = {"/world/actors": ACTOR_DTYPE, "/world/signals": SIGNAL_DTYPE}
_EVENTS = "/world/events"
_Tables = dict[str, Table]


class Replay:
    """A source of world states that reads a bag. Weather comes from the scene's specification.

    Lamps that are lit by darkness follow the weather; all else of actors and signals is as recorded, to the byte.
    """

    def __init__(self, spec: SceneSpec, path: Path) -> None:
        """Open a bag.

        Args:
            spec: The scene, ``replayed_spec`` of this bag.
            path: The bag.

        Raises:
            BagError: there is no bag, it is damaged, or it holds no scene that could be replayed.
        """
        self._spec = spec
        self._bag = SceneBag(path)
        try:
            self._recorded = recorded_spec(self._bag)
            self.available = self._available()
            self._events = self._read_events()
            self._frames = self._read()
            self._ahead = next(self._frames)
        except BaseException:
            self._bag.close()
            raise
        self._tick = -spec.warm_up_ticks

    def drive_ego(self, speed_mps: float, yaw_rate_radps: float) -> None:
        """Nothing: the ego moves as it has moved."""

    def step(self) -> WorldState:
        """The state one tick on, at first that of the warm-up's first tick.

        Of ticks before the recorded ones all are where they are at first.

        Raises:
            BagError: the bag is damaged here.
        """
        stamp_ns, tables = self._ahead
        if self._spec.stamp_ns(self._tick) >= stamp_ns:
            self._ahead = next(self._frames, self._ahead)
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(self._tick),
            tick=self._tick,
            ego_id=EGO_ID,
            actors=self._lit(tables["/world/actors"]),
            signals=tables["/world/signals"],
            weather=self._spec.weather_at(self._tick),
            events=tuple(self._events[self._spec.stamp_ns(self._tick)]),
        )
        self._tick += 1
        return state

    def close(self) -> None:
        """Close the bag."""
        self._bag.close()

    def _available(self) -> tuple[int, str]:
        """How many ticks from tick 0 on are whole."""
        missing = [name for name in _TABLES if name not in self._bag.topics]
        if missing:
            raise BagError(f"{self._bag.path}: cannot be replayed without topic {', '.join(missing)}")
        stamps = set.intersection(*(set(self._bag.topics[name].stamps_ns.tolist()) for name in _TABLES))
        ticks = 0
        while ticks < self._recorded.ticks and self._recorded.stamp_ns(ticks) in stamps:
            ticks += 1
        if not ticks:
            raise BagError(f"{self._bag.path}: cannot be replayed: the first tick is not in the bag")
        if ticks < int(self._bag.fact("ticks") or self._recorded.ticks):
            return ticks, f"the replayed bag ends at tick {ticks - 1}"
        return ticks, self._bag.custom_data.get("ended", DURATION)

    def _read(self) -> Iterator[tuple[int, _Tables]]:
        """Stamp and tables of every tick that is whole, in order."""
        lead_in = lead_in_messages(self._bag.attachments.get(LEAD_IN_ATTACHMENT, b"[]"))
        last_ns = self._recorded.stamp_ns(self.available[0] - 1)
        waiting: defaultdict[int, _Tables] = defaultdict(dict)
        for message in chain(lead_in, self._bag.messages(list(_TABLES), to_ns=last_ns)):
            tables = waiting[message.stamp_ns]
            tables[message.topic] = self._table(message)
            if len(tables) == len(_TABLES):
                yield message.stamp_ns, waiting.pop(message.stamp_ns)

    def _read_events(self) -> defaultdict[int, list[Event]]:
        """All events, by stamp."""
        events: defaultdict[int, list[Event]] = defaultdict(list)
        for message in self._bag.messages([_EVENTS]):
            try:
                fields = json.loads(self._bag.decode(message).data)
                place, ids = tuple(map(float, fields["position_m"])), tuple(map(int, fields["ids"]))
                event = Event(fields["type"], ids, place, float(fields["relative_speed_mps"]))  # type: ignore[arg-type]
            except (ValueError, KeyError, TypeError) as error:
                raise BagError(f"{self._bag.path}: {_EVENTS} at {message.stamp_ns} ns: {error!r}") from None
            events[message.stamp_ns].append(event)
        return events

    def _table(self, message: RawMessage) -> Table:
        table = point_array(self._bag.decode(message))
        wanted = _TABLES.get(message.topic)
        if table.dtype != wanted:
            raise BagError(f"{self._bag.path}: {message.topic} has other columns than this version of simbev writes")
        return table

    def _lit(self, actors: Table) -> Table:
        """Vehicles with their low beams as the weather now demands, if that is not as it was."""
        lit = needs_low_beam(self._spec.weather_at(self._tick))
        if lit == needs_low_beam(self._recorded.weather_at(self._tick)):
            return actors
        changed = actors.copy()
        vehicles = changed["id"] < EGO_ID + len(self._spec.vehicles)
        dark = changed["lights"] & ~np.uint16(Light.LOW_BEAM)
        changed["lights"] = np.where(vehicles, dark | np.uint16(Light.LOW_BEAM if lit else 0), changed["lights"])
        return changed


def recorded_spec(bag: SceneBag) -> SceneSpec:
    """The scene that a bag was recorded of.

    Raises:
        BagError: the bag does not hold it, or holds one of another version.
    """
    spec = bag.spec
    if spec is None:
        raise BagError(f"{bag.path}: cannot be replayed: {SCENE_ATTACHMENT} is not attached")
    return spec


def load_recorded_roads(bag: SceneBag) -> None:
    """Build the roads of a bag's map from the file in the bag, which may be gone from where it was.

    They are in the cache then, where all find them who look for the map by the content of its file.

    Raises:
        BagError: the file in the bag is damaged.
        InputError: the roads cannot be built from it.
    """
    source = bag.attachments.get(MAP_SOURCE_ATTACHMENT)
    if source is None:
        return
    spec = recorded_spec(bag).map
    with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
        copy = Path(folder, Path(spec.path).name)
        try:
            copy.write_bytes(gzip.decompress(source))
        except (EOFError, OSError, zlib.error) as error:
            raise BagError(f"{bag.path}: {MAP_SOURCE_ATTACHMENT}: {error}") from None
        load_network(spec.model_copy(update={"path": str(copy)}))


def replayed_spec(bag: SceneBag, scenario: Scenario, network: RoadNetwork) -> SceneSpec:
    """The scene of a bag with a configuration's rig and annotation, and its weather and lights if it speaks of them.

    Args:
        bag: The bag.
        scenario: The configuration.
        network: The roads of the bag's map.

    Raises:
        BagError: the bag holds no scene, or it was recorded on other roads.
        InputError: the configuration has other ticks.
    """
    spec = recorded_spec(bag)
    if spec.tick_ns != scenario.time.tick_ns:
        raise InputError(f"time.tick_s: {scenario.time.tick_s:g}, but {bag.path} has ticks of {spec.tick_ns / 1e9:g} s")
    recorded_map = bag.attachments.get(MAP_ATTACHMENT)
    if recorded_map is not None and recorded_map != network.opendrive.encode():
        raise BagError(f"{bag.path}: was recorded on other roads than map {spec.map.name} has now")
    changes: dict[str, object] = {"rig": scenario.rig, "annotation": scenario.annotation}
    if "weather" in scenario.model_fields_set:
        is_hilly = Starts(network, scenario.traffic.waypoint_spacing_m).is_hilly
        changes["weather"], changes["final_weather"] = draw_weathers(scenario.weather, spec.seed, hilly=is_hilly)
    if "lights" in scenario.model_fields_set:
        changes["lights"] = draw_lights(scenario.lights, spec.seed)
    return spec.model_copy(update=changes)
