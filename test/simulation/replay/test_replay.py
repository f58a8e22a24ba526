"""Replay of a bag without a graph: states equal the recorded ones, and unsuitable bags are refused."""

import bz2
import shutil
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType

import drive_cases
import numpy as np
import pytest
from peak_memory import at_most
from rosbags.typesys import Stores, get_typestore

from simbev_ros.config.drive import Drive
from simbev_ros.config.load import load_scenario
from simbev_ros.config.weather import WeatherConfig
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.types import Table
from simbev_ros.maps.build import load_network, load_source
from simbev_ros.maps.source import map_spec
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.lead_in import lead_in_attachment
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.scene.drawing.draw_scene import draw_scene, planned_scenes
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, Event, Light, WorldState
from simbev_ros.simulation.replay import replay
from simbev_ros.simulation.replay.replay import Replay, build_recorded_roads, recorded_spec, replayed_spec
from simbev_ros.simulation.world.simulation import Simulation

FUZZED = Path(__file__).parents[2] / "fuzz/corpus/bag/index_of_messages_that_are_not_there"
TYPES = get_typestore(Stores.ROS2_JAZZY)
CODES = {"i1": 1, "u1": 2, "i2": 3, "u2": 4, "i4": 5, "u4": 6, "f4": 7, "f8": 8}
DTYPES = {"/world/actors": ACTOR_DTYPE, "/world/signals": SIGNAL_DTYPE}
CLOUD = "sensor_msgs/msg/PointCloud2"


def small_spec() -> SceneSpec:
    scenario = load_scenario("demo")
    traffic = scenario.traffic.model_copy(update={"vehicles": 6, "pedestrians": 6})
    scenario = scenario.model_copy(update={"traffic": traffic})
    planned = next(planned_scenes(scenario))
    spec = draw_scene(scenario, planned, load_network(planned.map))
    return spec.model_copy(update={"ticks": 6})


SPEC = small_spec()
ATTACHMENT = "map_source.bz2"


def cloud(table: Table, stamp_ns: int) -> bytes:
    types = TYPES.types
    stamp = types["builtin_interfaces/msg/Time"](*divmod(stamp_ns, 10**9))
    fields = [
        types["sensor_msgs/msg/PointField"](name, table.dtype.fields[name][1], CODES[table.dtype[name].str[1:]], 1)
        for name in table.dtype.names
    ]
    size = table.dtype.itemsize
    data = np.frombuffer(table.tobytes(), np.uint8)
    header = types["std_msgs/msg/Header"](stamp, "map")
    message = types[CLOUD](header, 1, len(table), fields, False, size, size * len(table), data, True)
    return bytes(TYPES.serialize_cdr(message, CLOUD))


def text(content: str) -> bytes:
    return bytes(TYPES.serialize_cdr(TYPES.types["std_msgs/msg/String"](content), "std_msgs/msg/String"))


def actors(tick: int) -> Table:
    table = np.zeros(3, ACTOR_DTYPE)
    table["id"], table["x"] = [1, 2, 900], tick + np.array([0.1, 0.2, 0.3])
    return table


def bag(
    folder: Path,
    ticks: Sequence[int] = range(6),
    lead_in: Sequence[int] = (-2, -1),
    scene: str | None = None,
    table_at: Callable[[int], Table] = actors,
    facts: Mapping[str, str] = MappingProxyType({}),
) -> Path:
    with SceneBagWriter(folder) as writer:
        writer.add_attachment("scene.json", "application/json", (scene or SPEC.model_dump_json()).encode())
        early = [
            RawMessage(name, SPEC.stamp_ns(tick), CLOUD, cloud(table, SPEC.stamp_ns(tick)))
            for tick in lead_in
            for name, table in (("/world/actors", table_at(tick)), ("/world/signals", np.zeros(2, SIGNAL_DTYPE)))
        ]
        writer.add_attachment("lead_in.json", "application/json", lead_in_attachment(early))
        for name in DTYPES:
            writer.add_topic(name, CLOUD, QosProfile())
        writer.add_topic("/world/events", "std_msgs/msg/String", QosProfile())
        for tick in ticks:
            stamp_ns = SPEC.stamp_ns(tick)
            writer.write("/world/actors", stamp_ns, cloud(table_at(tick), stamp_ns))
            writer.write("/world/signals", stamp_ns, cloud(np.zeros(2, SIGNAL_DTYPE), stamp_ns))
            if tick == 3:
                event = (
                    '{"type": "collision", "tick": 3, "ids": [1, 2], "position_m": [1, 2, 3], "relative_speed_mps": 4}'
                )
                writer.write("/world/events", stamp_ns, text(event))
        return writer.finish(facts)


def states(replay: Replay, count: int) -> list:
    all_states = [replay.step() for _ in range(SPEC.warm_up_ticks + count)]
    assert [state.tick for state in all_states] == list(range(-SPEC.warm_up_ticks, count))
    return all_states


def test_every_tick_is_replayed_with_its_bytes_stamp_and_events(tmp_path: Path) -> None:
    replay = Replay(SPEC, bag(tmp_path / "a"))
    assert replay.available == (6, "duration")
    for state in states(replay, 6):
        assert state.stamp_ns == SPEC.stamp_ns(state.tick)
        assert state.actors.tobytes() == actors(max(state.tick, -2)).tobytes()
        assert state.events == ((Event("collision", (1, 2), (1.0, 2.0, 3.0), 4.0),) if state.tick == 3 else ())
    replay.close()


def test_without_a_lead_in_all_actors_start_where_they_are_at_tick_0(tmp_path: Path) -> None:
    replay = Replay(SPEC, bag(tmp_path / "a", lead_in=()))
    assert [state.actors["x"][0] for state in states(replay, 3)[-4:]] == [0.1, 0.1, 1.1, 2.1]
    replay.close()


@pytest.mark.parametrize(
    ("ticks", "facts", "available"),
    [
        (range(6), {"ticks": "6", "ended": "duration"}, (6, "duration")),
        (range(4), {"ticks": "4", "ended": "ego stood still"}, (4, "ego stood still")),
        (range(4), {"ticks": "6", "ended": "interrupted"}, (4, "the replayed bag ends at tick 3")),
        ((0, 1, 2, 4, 5), {"ticks": "6", "ended": "duration"}, (3, "the replayed bag ends at tick 2")),
        ((0, 1, 2, 4, 5), {}, (3, "the replayed bag ends at tick 2")),
    ],
)
def test_a_replay_ends_like_the_scene_or_before_the_first_missing_tick(
    tmp_path: Path, ticks: Sequence[int], facts: dict[str, str], available: tuple[int, str]
) -> None:
    replay = Replay(SPEC, bag(tmp_path / "a", ticks=ticks, facts=facts))
    assert replay.available == available
    replay.close()


def test_at_night_only_the_low_beams_of_vehicles_change(tmp_path: Path) -> None:
    night = SPEC.model_copy(update={"weather": SPEC.weather.model_copy(update={"sun_altitude_deg": -40.0})})
    replay = Replay(night, bag(tmp_path / "a"))
    table = states(replay, 1)[-1].actors
    assert table["lights"].tolist() == [Light.LOW_BEAM, Light.LOW_BEAM, 0]
    table["lights"] = 0
    assert table.tobytes() == actors(0).tobytes()
    replay.close()


def test_a_day_scene_replayed_at_night_equals_a_simulated_night_scene(tmp_path: Path) -> None:
    night = SPEC.model_copy(update={"weather": SPEC.weather.model_copy(update={"sun_altitude_deg": -40.0})})

    def simulated(spec: SceneSpec) -> list[WorldState]:
        with Simulation(spec, load_network(spec.map)) as simulation:
            return [simulation.step() for _ in range(spec.warm_up_ticks + 6)]

    by_day, by_night = simulated(SPEC), simulated(night)
    assert by_day[-1].actors.tobytes() != by_night[-1].actors.tobytes()
    replay = Replay(night, bag(tmp_path / "a", table_at=lambda tick: by_day[tick + SPEC.warm_up_ticks].actors))
    for again, truth in zip(states(replay, 6)[-8:], by_night[-8:], strict=True):
        assert again.actors.tobytes() == truth.actors.tobytes()
    replay.close()


def test_rig_and_weather_come_from_the_configuration(tmp_path: Path) -> None:
    scenario = load_scenario("paper")
    network = load_network(SPEC.map)
    with SceneBag(bag(tmp_path / "a")) as recorded:
        kept = replayed_spec(recorded, scenario, network)
        assert kept.agents[0].rig == scenario.rig
        for name in ("vehicles", "pedestrians", "seed", "ticks"):
            assert getattr(kept, name) == getattr(SPEC, name)
        assert kept.map == SPEC.map.model_copy(update={"season": "summer"})
        drawn = scenario.model_copy(update={"weather": WeatherConfig(cloudiness=10.0)})
        assert replayed_spec(recorded, drawn, network).map == SPEC.map
        slow = scenario.model_copy(update={"time": scenario.time.model_copy(update={"tick_s": 0.1})})
        with pytest.raises(InputError, match=r"time\.tick_s: 0\.1, but .* has ticks of 0\.05 s"):
            replayed_spec(recorded, slow, network)


@pytest.mark.parametrize("has_section", [True, False])
def test_a_drive_remains_one_if_the_configuration_has_the_section(tmp_path: Path, has_section: bool) -> None:
    spec = SPEC.model_copy(update={"drive": drive_cases.spec().drive})
    scenario = load_scenario("demo").model_copy(update={"drive": Drive() if has_section else None})
    with SceneBag(bag(tmp_path / "a", scene=spec.model_dump_json())) as recorded:
        replayed = replayed_spec(recorded, scenario, load_network(SPEC.map))
    assert replayed.drive == (spec.drive if has_section else None)


def test_the_roads_of_a_missing_map_file_come_from_the_bag(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "one"))
    file = Path(shutil.copy(Path(__file__).parents[2] / "maps/data/riverside.osm", tmp_path))
    spec = SPEC.model_copy(update={"map": map_spec(str(file))})
    roads, source = load_network(spec.map), load_source(spec.map)
    with SceneBagWriter(tmp_path / "bag") as writer:
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        writer.add_attachment("map.xodr", "application/xml", roads.opendrive.encode())
        writer.add_attachment("map_source.bz2", "application/x-bzip2", source)
        writer.finish({})
    file.unlink()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "another"))
    with pytest.raises(InputError, match=r"riverside\.osm: cannot be read: No such file"):
        load_network(spec.map)
    with SceneBag(tmp_path / "bag") as recorded:
        build_recorded_roads(recorded)
        again = load_network(spec.map)
        assert replayed_spec(recorded, load_scenario("demo"), again).map == spec.map
    assert again.lanes.keys() == roads.lanes.keys()
    assert load_source(spec.map) == source


def test_a_part_of_a_map_is_replayed_from_the_extract_in_the_bag(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "one"))
    file = Path(shutil.copy(Path(__file__).parents[2] / "maps/data/riverside.osm", tmp_path))
    spec = SPEC.model_copy(update={"map": map_spec(str(file), bounds=(7.4960, 52.2480, 7.5035, 52.2530))})
    roads = load_network(spec.map)
    with SceneBagWriter(tmp_path / "bag") as writer:
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        writer.add_attachment("map.xodr", "application/xml", roads.opendrive.encode())
        writer.add_attachment("map_source.bz2", "application/x-bzip2", load_source(spec.map))
        writer.finish({})
    file.unlink()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "another"))
    with SceneBag(tmp_path / "bag") as recorded:
        chosen = build_recorded_roads(recorded)
        assert chosen.bounds is None and chosen.name == spec.map.name
        replayed = replayed_spec(recorded, load_scenario("demo"), load_network(chosen), chosen)
    assert replayed.map == chosen
    assert load_network(chosen).opendrive == roads.opendrive


def test_the_map_file_in_a_bag_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found: list[tuple[str, bytes]] = []
    monkeypatch.setattr(replay, "load_network", lambda spec: found.append((spec.path, Path(spec.path).read_bytes())))
    town = MapSpec(name="my_town", path="/gone/my town.osm.xml", sha256="0" * 64)
    with SceneBagWriter(tmp_path / "bag") as writer:
        spec = SPEC.model_copy(update={"map": town})
        writer.add_attachment("scene.json", "application/json", spec.model_dump_json().encode())
        writer.add_attachment(ATTACHMENT, "application/octet-stream", bz2.compress(b"<osm/>"))
        writer.finish({})
    with SceneBag(tmp_path / "bag") as recorded:
        build_recorded_roads(recorded)
    ((path, content),) = found
    assert Path(path).name == "my_town.osm.xml" and content == b"<osm/>"


@pytest.mark.parametrize("content", [b"not compressed", bz2.compress(b"<x/>")[:-1]])
def test_a_damaged_map_file_in_a_bag_is_refused(tmp_path: Path, content: bytes) -> None:
    with SceneBagWriter(tmp_path / "bag") as writer:
        writer.add_attachment("scene.json", "application/json", SPEC.model_dump_json().encode())
        writer.add_attachment(ATTACHMENT, "application/octet-stream", content)
        writer.finish({})
    with SceneBag(tmp_path / "bag") as recorded, pytest.raises(BagError, match=f"bag: {ATTACHMENT}: "):
        build_recorded_roads(recorded)


def test_a_map_file_that_unpacks_to_more_than_a_map_may_have_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simbev_ros.simulation.replay.replay.MAX_OSM_BYTES", 1 << 20)
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_attachment("scene.json", "application/json", SPEC.model_dump_json().encode())
        writer.add_attachment(ATTACHMENT, "application/octet-stream", bz2.compress(bytes(64 << 20)))
        writer.finish({})
    with (
        SceneBag(tmp_path / "a") as bomb,
        at_most(16),
        pytest.raises(BagError, match=f"{ATTACHMENT}: it unpacks to more"),
    ):
        build_recorded_roads(bomb)


def test_bags_that_hold_no_scene_are_refused(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "empty") as writer:
        writer.finish({})
    with SceneBag(tmp_path / "empty") as empty, pytest.raises(BagError, match=r"scene\.json is not attached"):
        recorded_spec(empty)
    with SceneBagWriter(tmp_path / "bare") as writer:
        writer.add_attachment("scene.json", "application/json", SPEC.model_dump_json().encode())
        writer.finish({})
    with pytest.raises(BagError, match="cannot be replayed without topic /world/actors, /world/signals"):
        Replay(SPEC, tmp_path / "bare")
    with pytest.raises(BagError, match="the first tick is not in the bag"):
        Replay(SPEC, bag(tmp_path / "late", ticks=(1, 2)))
    with SceneBag(FUZZED) as fuzzed, pytest.raises(BagError, match="the messages of no tick are complete"):
        Replay(recorded_spec(fuzzed), FUZZED)


def with_columns(folder: Path, monkeypatch: pytest.MonkeyPatch, dtype: np.dtype[np.void]) -> Path:
    """A bag whose actors have other columns than this version writes."""
    monkeypatch.setitem(DTYPES, "/world/actors", dtype)
    with SceneBagWriter(folder) as writer:
        writer.add_attachment("scene.json", "application/json", SPEC.model_dump_json().encode())
        for name, each in DTYPES.items():
            writer.add_topic(name, CLOUD, QosProfile())
            writer.write(name, SPEC.start_ns, cloud(np.ones(2, each), SPEC.start_ns))
        writer.finish({})
    return folder


def test_tables_that_lack_a_column_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = with_columns(tmp_path / "old", monkeypatch, np.dtype([("x", "<f8")]))
    with pytest.raises(BagError, match="/world/actors has other columns than this version"):
        Replay(SPEC, folder)


def test_columns_that_are_not_known_are_ignored(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = with_columns(tmp_path / "new", monkeypatch, np.dtype([("snow", "<f4"), *ACTOR_DTYPE.descr]))
    replay = Replay(SPEC, folder)
    ticks = dict(replay._read_ticks())
    np.testing.assert_array_equal(ticks[SPEC.start_ns]["/world/actors"], np.ones(2, ACTOR_DTYPE))
    replay.close()
