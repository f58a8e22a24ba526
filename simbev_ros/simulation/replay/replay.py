"""Replay of a recorded scene: its actors and signals again, tick by tick, with another rig or other weather."""

import hashlib
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from itertools import chain
from pathlib import Path

import numpy as np

from simbev_ros.config.map_files import suffix_of
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, InputError, LimitError
from simbev_ros.foundation.files.limits import MAX_OSM_BYTES
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.files.unpacking import bunzip2
from simbev_ros.foundation.types import Table
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.source import is_street_map
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.layout import (
    LEAD_IN_ATTACHMENT,
    MAP_ATTACHMENT,
    MAP_SOURCE_ATTACHMENT,
    SCENE_ATTACHMENT,
)
from simbev_ros.recording.lead_in import lead_in_messages
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.scene.drawing.draw_lights import draw_appearance, draw_lights
from simbev_ros.scene.drawing.draw_scene import datum_spec
from simbev_ros.scene.drawing.draw_v2x import draw_v2x
from simbev_ros.scene.drawing.draw_weather import draw_season, draw_weathers, fog_fills_heights
from simbev_ros.scene.drawing.starts import StartPositions
from simbev_ros.scene.ending import DURATION
from simbev_ros.scene.weather_course import WeatherCourse
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, Event, Light, SignalState, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import read_stored
from simbev_ros.simulation.replay.replayed_agents import replayed_agents
from simbev_ros.simulation.world.driving.commands import DriverCommand

_TABLES = {"/world/actors": ACTOR_DTYPE, "/world/signals": SIGNAL_DTYPE}
_EVENTS, _WEATHER = "/world/events", "/world/weather"
_Tables = dict[str, Table]


class Replay:
    """A source of world states that reads actors and signals from a bag and takes the weather from a specification.

    Low beams follow the weather; everything else about actors and signals is byte for byte as recorded.

    Attributes:
        weather: Weather at each tick: that of the specification, or if it is the recorded one, as it was at that tick.
        available: Number of complete ticks from tick 0 on, and the reason why the scene ends after them.
    """

    def __init__(self, spec: SceneSpec, path: Path) -> None:
        """Open a bag.

        Args:
            spec: Specification of the replayed scene, from ``replayed_spec``.
            path: The bag.

        Raises:
            BagError: There is no bag, it is damaged, or it holds no scene that can be replayed.
        """
        self._spec = spec
        self._bag = SceneBag(path)
        try:
            self._recorded = recorded_spec(self._bag)
            self.available = self._available_ticks()
            self._events = self._read_events()
            weathers = self._read_weathers()
            self._recorded_weather = WeatherCourse(self._recorded, weathers)
            drawn = [(each.weather, each.final_weather) for each in (spec, self._recorded)]
            self.weather = WeatherCourse(spec, weathers if drawn[0] == drawn[1] else {})
            self._frames = self._read_ticks()
            first = next(self._frames, None)
            if first is None:
                raise BagError(f"{path}: cannot be replayed: the messages of no tick are complete")
            self._next_frame = first
        except BaseException:
            self._bag.close()
            raise
        self._tick = -spec.warm_up_ticks

    @property
    def entities(self) -> None:
        """No commands have an effect on actors."""

    def drive_vehicle(self, vehicle: int, speed_mps: float, yaw_rate_radps: float) -> None:
        """Do nothing: all vehicles move as they were recorded."""

    def follow_command(self, vehicle: int, command: DriverCommand) -> None:
        """Do nothing, as ``drive_vehicle``."""

    def hold_signal(self, head: int, state: SignalState | None) -> int:
        """Refuse, as all traffic has reacted to the lights as they were recorded."""
        raise InputError("a replay shows the traffic lights as they were recorded")

    def adopt_entity(self, actor: int, actors: Table) -> None:
        """Refuse, as ``hold_signal``."""
        raise InputError("a replay shows all actors as they were recorded")

    def step(self) -> WorldState:
        """Advance by one tick and return the state; the first call returns that of the first warm-up tick.

        Before the first recorded tick all actors are where they are in it.

        Raises:
            BagError: The bag is damaged at this tick.
        """
        stamp_ns, tables = self._next_frame
        if self._spec.stamp_ns(self._tick) >= stamp_ns:
            self._next_frame = next(self._frames, self._next_frame)
        state = WorldState(
            stamp_ns=self._spec.stamp_ns(self._tick),
            tick=self._tick,
            ego_id=EGO_ID,
            actors=self._with_low_beams(tables["/world/actors"]),
            signals=tables["/world/signals"],
            weather=self.weather.at(self._tick),
            events=tuple(self._events[self._spec.stamp_ns(self._tick)]),
        )
        self._tick += 1
        return state

    def close(self) -> None:
        """Close the bag."""
        self._bag.close()

    def _available_ticks(self) -> tuple[int, str]:
        """Number of complete ticks from tick 0 on, and the reason why the scene ends after them."""
        missing = [name for name in _TABLES if name not in self._bag.topics]
        if missing:
            raise BagError(f"{self._bag.path}: cannot be replayed without topic {', '.join(missing)}")
        stamps = set.intersection(*(set(self._bag.topics[name].stamps_ns.tolist()) for name in _TABLES))
        ticks = 0
        while ticks < self._recorded.ticks and self._recorded.stamp_ns(ticks) in stamps:
            ticks += 1
        if not ticks:
            raise BagError(f"{self._bag.path}: cannot be replayed: the first tick is not in the bag")
        if ticks < (self._bag.recorded_ticks or self._recorded.ticks):
            return ticks, f"the replayed bag ends at tick {ticks - 1}"
        return ticks, self._bag.custom_data.get("ended", DURATION)

    def _read_ticks(self) -> Iterator[tuple[int, _Tables]]:
        """Yield stamp and tables of every complete tick, in order."""
        lead_in = lead_in_messages(self._bag.attachments.get(LEAD_IN_ATTACHMENT, b"[]"))
        last_ns = self._recorded.stamp_ns(self.available[0] - 1)
        waiting: defaultdict[int, _Tables] = defaultdict(dict)
        for message in chain(lead_in, self._bag.messages(list(_TABLES), to_ns=last_ns)):
            tables = waiting[message.stamp_ns]
            tables[message.topic] = self._table(message)
            if len(tables) == len(_TABLES):
                yield message.stamp_ns, waiting.pop(message.stamp_ns)

    def _read_events(self) -> defaultdict[int, list[Event]]:
        """Read all events, by stamp."""
        events: defaultdict[int, list[Event]] = defaultdict(list)
        for message in self._bag.messages([_EVENTS]):
            try:
                fields = parse_json(self._bag.decode(message).data)
                position_m, ids = tuple(map(float, fields["position_m"])), tuple(map(int, fields["ids"]))
                event = Event(fields["type"], ids, position_m, float(fields["relative_speed_mps"]))  # type: ignore[arg-type]
            except FOREIGN_ERRORS as error:
                raise BagError(f"{self._bag.path}: {_EVENTS} at {message.stamp_ns} ns: {error!r}") from None
            events[message.stamp_ns].append(event)
        return events

    def _read_weathers(self) -> dict[int, Weather]:
        """Read the weather at each tick, which commands may have changed; empty if it was not recorded."""
        weathers: dict[int, Weather] = {}
        for message in self._bag.messages([_WEATHER]):
            try:
                fields = parse_json(self._bag.decode(message).data)
                fields.pop("stamp_ns")
                weathers[self._recorded.tick_of(message.stamp_ns)] = read_stored(Weather, fields)
            except FOREIGN_ERRORS as error:
                raise BagError(f"{self._bag.path}: {_WEATHER} at {message.stamp_ns} ns: {error!r}") from None
        return weathers

    def _table(self, message: RawMessage) -> Table:
        """The rows of a message with the columns that this version has; others are ignored."""
        table, wanted = point_array(self._bag.decode(message)), _TABLES[message.topic]
        names = wanted.names or ()
        if not {*names} <= {*(table.dtype.names or ())} or any(table.dtype[name] != wanted[name] for name in names):
            raise BagError(f"{self._bag.path}: {message.topic} has other columns than this version of simbev writes")
        if table.dtype == wanted:
            return table
        rows = np.zeros(len(table), wanted)
        for name in names:
            rows[name] = table[name]
        return rows

    def _with_low_beams(self, actors: Table) -> Table:
        """Actors with the low beams of vehicles switched as the current weather demands."""
        lit = self.weather.at(self._tick).needs_low_beam
        if lit == self._recorded_weather.at(self._tick).needs_low_beam:
            return actors
        changed = actors.copy()
        vehicles = changed["id"] < EGO_ID + len(self._spec.vehicles)
        unlit = changed["lights"] & ~np.uint16(Light.LOW_BEAM)
        changed["lights"] = np.where(vehicles, unlit | np.uint16(Light.LOW_BEAM if lit else 0), changed["lights"])
        return changed


def recorded_spec(bag: SceneBag) -> SceneSpec:
    """Specification of the scene that a bag was recorded from, for a replay.

    Raises:
        BagError: The bag holds no scene, or one of another version.
    """
    spec = bag.spec
    if spec is None:
        raise BagError(f"{bag.path}: cannot be replayed: {SCENE_ATTACHMENT} is not attached")
    return spec


def build_recorded_roads(bag: SceneBag) -> MapSpec:
    """Build the road network of a bag's map from the map file in the bag, as the original file may be gone.

    The network is then in the cache, where it is found by the content of the map file.

    Returns:
        The map: that of the scene, or, if the bag holds only the part of an OpenStreetMap file that was read, a map of
        that part.

    Raises:
        BagError: The map file in the bag is damaged, or larger than a map file may be.
        InputError: The roads cannot be built from it.
    """
    spec, source = recorded_spec(bag).map, _map_source(bag)
    if source is None:
        return spec
    digest = hashlib.sha256(source).hexdigest()
    if digest != spec.sha256 and is_street_map(suffix_of(spec.path)):
        spec = spec.model_copy(update={"sha256": digest, "bounds": None})
    with tempfile.TemporaryDirectory(prefix="simbev-") as folder:
        copy = Path(folder, f"{spec.name}{suffix_of(spec.path)}")
        copy.write_bytes(source)
        load_network(spec.model_copy(update={"path": str(copy)}))
    return spec


def _map_source(bag: SceneBag) -> bytes | None:
    """The map file in a bag, or the part of it that was read; None if the map is a built-in town."""
    if MAP_SOURCE_ATTACHMENT not in bag.attachments:
        return None
    try:
        return bunzip2(bag.attachments[MAP_SOURCE_ATTACHMENT], MAX_OSM_BYTES)
    except (EOFError, OSError, LimitError) as error:
        raise BagError(f"{bag.path}: {MAP_SOURCE_ATTACHMENT}: {error}") from None


def replayed_spec(bag: SceneBag, scenario: Scenario, network: RoadNetwork, chosen: MapSpec | None = None) -> SceneSpec:
    """Specification for replaying a bag with another configuration.

    The agents with their rigs and labels come from the configuration (see ``replayed_agents``), and so
    do weather and lights if it sets them; everything else is as recorded. A drive remains one if the configuration has
    the section ``drive``.

    Args:
        bag: The bag.
        scenario: The configuration.
        network: Road network of the bag's map.
        chosen: That map, as ``build_recorded_roads`` returned it; None: as recorded.

    Raises:
        BagError: The bag holds no scene, or it was recorded on other roads.
        InputError: The configuration has another tick length, or an agent that the scene has no vehicle for.
    """
    spec = recorded_spec(bag)
    if spec.tick_ns != scenario.time.tick_ns:
        raise InputError(
            f"time.tick_s: {scenario.time.tick_s:g}, but {bag.path} has ticks of {spec.tick_ns / NS_PER_S:g} s"
        )
    recorded_map = bag.attachments.get(MAP_ATTACHMENT)
    if recorded_map is not None and not network.has_opendrive(recorded_map):
        raise BagError(f"{bag.path}: was recorded on other roads than map {spec.map.name} has now")
    starts = StartPositions(network, scenario.traffic.waypoint_spacing_m)
    agents = replayed_agents(spec, scenario, network, starts)
    here = chosen or spec.map
    redrawn = "weather" in scenario.model_fields_set
    weather, season = scenario.weather, spec.map.season
    if redrawn and not (weather.season is None and weather.sun is None):
        season = draw_season(weather, spec.seed, network.datum)
    changes: dict[str, object] = {
        "agents": agents,
        "v2x": draw_v2x(scenario, spec.seed, [agent.name for agent in agents]),
        "map": here.model_copy(update={"season": season}),
        "datum": spec.datum or datum_spec(network.datum),
        "drive": None if scenario.drive is None else spec.drive,  # without the section the graph has no referee
    }
    if redrawn:
        even_fog = fog_fills_heights(here, network)
        changes["weather"], changes["final_weather"] = draw_weathers(
            weather.model_copy(update={"season": season}), spec.seed, even_fog=even_fog, datum=network.datum
        )
    if "lights" in scenario.model_fields_set:
        changes["lights"] = draw_lights(scenario.lights, spec.seed)
    if "appearance" in scenario.model_fields_set:
        changes["appearance"] = draw_appearance(scenario.appearance, spec.seed)
    return spec.model_copy(update=changes)
