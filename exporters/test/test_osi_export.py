"""Tests of OSI's ground truth: read back by OSI's own reader, it equals the tables of the bag."""

from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_up_scene import SENSORS, made_up_scene, made_up_spec, record_made_up
from nuscenes_tables import digest
from scipy.spatial.transform import Rotation
from several_agents import roadside_unit, with_agents
from typer.testing import CliRunner

pytest.importorskip("osi3", reason="osi-python is the exporters' extra osi")

from mcap.reader import make_reader
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_lane_pb2 import Lane
from osi3.osi_object_pb2 import MovingObject, StationaryObject
from osi3.osi_trafficlight_pb2 import TrafficLight
from osi3trace.osi_trace import OSITrace

from simbev_exporters.cli import osi as osi_command
from simbev_exporters.osi import export as osi_export
from simbev_exporters.osi import objects
from simbev_exporters.osi.export import Exported, export_osi
from simbev_exporters.osi.objects import ActorMessages, moving_names, osi_names
from simbev_exporters.osi.surroundings import environment, traffic_lights
from simbev_ros.assets.street import signal_poles
from simbev_ros.cli.main import app
from simbev_ros.dataset import Scene, open_dataset
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import Extra
from simbev_ros.maps.roads.lane_kind import LaneKind
from simbev_ros.maps.roads.layout import Paint
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.scene.legend import legend
from simbev_ros.schema.scene.state import ACTOR_DTYPE, SIGNAL_DTYPE, map_from_actors

TICKS = 4


def export(dataset: Path, out: Path) -> Exported:
    return export_osi(open_dataset(dataset, threads=1), out)


def read(folder: Path) -> list[GroundTruth]:
    """The messages of the only trace in a folder, by OSI's reader."""
    (file,) = folder.glob("*.mcap")
    trace = OSITrace(str(file), "GroundTruth")
    messages = list(trace)
    trace.close()
    return messages


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A dataset of one scene, ``set``, and its export, ``out``."""
    folder = tmp_path_factory.mktemp("osi")
    made_up_scene(folder / "set/scenes/train/Blocks-0000", ticks=TICKS)
    assert export(folder / "set", folder / "out").messages == TICKS
    return folder


@pytest.fixture(scope="module")
def scene(folder: Path) -> Scene:
    return open_dataset(folder / "set").scenes[0]


@pytest.fixture(scope="module")
def truths(folder: Path) -> list[GroundTruth]:
    return read(folder / "out")


def test_the_trace_has_the_metadata_that_osi_demands(folder: Path) -> None:
    (file,) = (folder / "out").glob("*.mcap")
    timestamp, kind, _, _, count, name = file.stem.split("_")
    assert (timestamp[-1], kind, count, name) == ("Z", "gt", str(TICKS), "Blocks-0000")
    with file.open("rb") as stream:
        reader = make_reader(stream)
        (metadata,) = reader.iter_metadata()
        assert metadata.name == "net.asam.osi.trace"
        assert {"version", "min_osi_version", "max_osi_version", "min_protobuf_version"} <= metadata.metadata.keys()
        summary = reader.get_summary()
        assert summary is not None
        (channel,), (schema,) = summary.channels.values(), summary.schemas.values()
        assert (schema.name, schema.encoding) == ("osi3.GroundTruth", "protobuf")
        assert channel.message_encoding == "protobuf"
        assert channel.metadata["net.asam.osi.trace.channel.osi_version"] == metadata.metadata["version"]
        assert len(summary.chunk_indexes) > 0
        stamps_ns = [(message.log_time, message.publish_time) for _, _, message in reader.iter_messages()]
    truths = read(folder / "out")
    expected = [each.timestamp.seconds * 10**9 + each.timestamp.nanos for each in truths]
    assert stamps_ns == list(zip(expected, expected, strict=True))


def test_moving_objects_are_the_actors(truths: list[GroundTruth], scene: Scene) -> None:
    for truth, frame in zip(truths, scene, strict=True):
        actors = {int(row["id"]): row for row in frame["world/actors"]}
        assert truth.timestamp.seconds * 10**9 + truth.timestamp.nanos == frame.stamp_ns
        assert truth.host_vehicle_id.value == 1 and truth.host_vehicle_id.value in actors
        for found in truth.moving_object:
            row = actors[found.id.value]
            pose, base = map_from_actors(row.reshape(1))[0], found.base
            up = pose[:3, :3] @ [0, 0, row["height"] / 2]
            center_m = pose[:3, 3] + up
            np.testing.assert_allclose([base.position.x, base.position.y, base.position.z], center_m)
            size_m = [base.dimension.length, base.dimension.width, base.dimension.height]
            np.testing.assert_allclose(size_m, [row[name] for name in ("length", "width", "height")])
            turn = Rotation.from_euler("xyz", [base.orientation.roll, base.orientation.pitch, base.orientation.yaw])
            np.testing.assert_allclose(turn.as_matrix(), pose[:3, :3], atol=1e-6)
            rate = np.array([row[name] for name in ("wx", "wy", "wz")], np.float64)
            velocity_mps = [row[name] for name in ("vx", "vy", "vz")] + np.cross(rate, up)
            np.testing.assert_allclose([base.velocity.x, base.velocity.y, base.velocity.z], velocity_mps, rtol=1e-5)
            acceleration = [base.acceleration.x, base.acceleration.y, base.acceleration.z]
            np.testing.assert_allclose(acceleration, [row[name] for name in ("ax", "ay", "az")])


def test_orientation_rates_are_derivatives_of_the_angles() -> None:
    rate, step_s = np.array([0.3, -0.7, 1.1]), 1e-6
    rows = np.zeros(1, ACTOR_DTYPE)
    rows["roll"], rows["pitch"], rows["yaw"] = 0.2, -0.4, 2.0
    rows["wx"], rows["wy"], rows["wz"] = rate
    (message,) = ActorMessages(legend()["blueprints"]).moving(rows)
    start = np.array([rows[name][0] for name in ("roll", "pitch", "yaw")], np.float64)
    later = (Rotation.from_rotvec(rate * step_s) * Rotation.from_euler("xyz", start)).as_euler("xyz")
    found = message.base.orientation_rate
    np.testing.assert_allclose([found.roll, found.pitch, found.yaw], (later - start) / step_s, rtol=1e-4)


def test_every_blueprint_has_a_type_and_only_props_stand() -> None:
    counts: Counter[str] = Counter()
    for blueprint in load_blueprints():
        names = moving_names(blueprint.name, blueprint.box_class)
        counts.update([names[0] if names else "none"])
        assert "OTHER" not in names, blueprint.name
        if blueprint.kind in ("pedestrian", "rider"):
            assert names[0] == ("VEHICLE" if blueprint.wheelchair else "PEDESTRIAN")
        elif blueprint.kind != "prop":
            assert len(names) == 3 and hasattr(MovingObject.VehicleClassification, f"TYPE_{names[1]}")
            assert hasattr(MovingObject.VehicleClassification, f"ROLE_{names[2]}")
            assert blueprint.emergency == (names[2] in ("POLICE", "AMBULANCE", "FIRE")), blueprint.name
        elif not names:
            assert blueprint.name in osi_names()["stationary"] or blueprint.name.startswith("prop.sign_")
    assert counts["VEHICLE"] > 30 and counts["PEDESTRIAN"] > 30
    known = [blueprint.name for blueprint in load_blueprints()]
    for pattern in [*osi_names()["moving"], *osi_names()["stationary"]]:
        assert any(fnmatchcase(name, pattern) for name in known), f"{pattern} is of no blueprint"


def test_vehicles_have_axles_lights_and_drivers() -> None:
    rows = np.zeros(2, ACTOR_DTYPE)
    rows["id"], rows["parent"] = [7, 8], [0, 7]
    rows["blueprint"] = [blueprint_index()[name] for name in ("vehicle.motorcycle", "rider.motorcycle")]
    rows["lights"] = [1 | 2 | 4 | 8 | 32, 0]
    motorcycle, rider = ActorMessages(legend()["blueprints"]).moving(rows)
    assert motorcycle.vehicle_attributes.driver_id.value == rider.id.value == 8
    assert rider.type == MovingObject.TYPE_PEDESTRIAN
    front, rear = (getattr(motorcycle.vehicle_attributes, f"bbcenter_to_{end}") for end in ("front", "rear"))
    assert front.x - rear.x == pytest.approx(1.46)
    assert front.z == rear.z == pytest.approx(0.31 - 1.21 / 2)
    state, kinds = motorcycle.vehicle_classification.light_state, MovingObject.VehicleClassification.LightState
    assert state.indicator_state == kinds.INDICATOR_STATE_WARNING
    assert state.brake_light_state == kinds.BRAKE_LIGHT_STATE_NORMAL
    assert state.head_light == state.tail_light == kinds.GENERIC_LIGHT_STATE_ON
    assert state.high_beam == state.reversing_light == kinds.GENERIC_LIGHT_STATE_OFF
    assert state.emergency_vehicle_illumination == kinds.GENERIC_LIGHT_STATE_FLASHING_BLUE


def test_cones_and_barriers_are_stationary() -> None:
    rows = np.zeros(3, ACTOR_DTYPE)
    rows["id"], rows["height"] = [2, 3, 4], 1.0
    rows["blueprint"] = [blueprint_index()[n] for n in ("prop.traffic_cone", "prop.water_barrier", "prop.worker")]
    messages = ActorMessages(legend()["blueprints"])
    cone, barrier = messages.stationary(rows)
    assert cone.classification.type == StationaryObject.Classification.TYPE_CONSTRUCTION_SITE_ELEMENT
    assert barrier.classification.type == StationaryObject.Classification.TYPE_BARRIER
    assert cone.base.position.z == 0.5
    assert [each.id.value for each in messages.moving(rows)] == [4]


@pytest.mark.parametrize(("state", "lit"), [(0, ""), (1, "r"), (2, "y"), (3, "g"), (4, "ry")])
def test_each_bulb_of_a_traffic_light_is_on_or_off(state: int, lit: str) -> None:
    rows = np.zeros(1, SIGNAL_DTYPE)
    rows["id"], rows["z"], rows["yaw"], rows["state"] = 5, 6.0, 1.0, state
    lights, kinds = traffic_lights(rows, ["17"]), TrafficLight.Classification
    colors = [kinds.COLOR_RED, kinds.COLOR_YELLOW, kinds.COLOR_GREEN]
    assert [each.classification.color for each in lights] == colors
    assert "".join(n for n, each in zip("ryg", lights, strict=True) if each.classification.mode == 3) == lit
    heights_m = [each.base.position.z - 6.0 for each in lights]
    assert heights_m == pytest.approx([signal_poles._LAMP_SPACING_M, 0.0, -signal_poles._LAMP_SPACING_M])
    assert lights[0].base.dimension.width == pytest.approx(2 * signal_poles._LAMP_RADIUS_M)
    assert lights[0].base.orientation.yaw == 1.0 and len({each.id.value for each in lights}) == 3
    assert list(lights[0].source_reference[0].identifier) == ["17"]


def test_signs_have_their_limits(truths: list[GroundTruth], scene: Scene) -> None:
    (sign,) = truths[0].traffic_sign
    (row,) = scene[0]["boxes"][scene[0]["boxes"]["sign"] > 0]
    position = sign.main_sign.base.position
    np.testing.assert_allclose([position.x, position.y, position.z], [row[name] for name in "xyz"])
    kinds = type(sign.main_sign.classification)
    assert sign.main_sign.classification.type == kinds.TYPE_SPEED_LIMIT_BEGIN
    assert sign.main_sign.classification.value.value == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("changes", "rain", "fog", "light"),
    [
        ({}, "NONE", "EXCELLENT_VISIBILITY", "LEVEL9"),
        ({"precipitation": 100}, "HEAVY", "MIST", "LEVEL9"),
        ({"fog_density": 100, "sun_altitude_deg": -20}, "NONE", "THICK", "LEVEL2"),
    ],
)
def test_weather_has_osis_levels(scene: Scene, changes: dict[str, float], rain: str, fog: str, light: str) -> None:
    clear = {"precipitation": 0.0, "fog_density": 0.0, "sun_altitude_deg": 40.0, "cloudiness": 50.0}
    found = environment(scene.spec.weather.model_copy(update={**clear, "fog_falloff": 0.0, **changes}), 7_500_000_000)
    assert found.precipitation == getattr(found, f"PRECIPITATION_{rain}")
    assert found.fog == getattr(found, f"FOG_{fog}")
    assert found.ambient_illumination == getattr(found, f"AMBIENT_ILLUMINATION_{light}")
    assert found.unix_timestamp == 7
    assert found.clouds.fractional_cloud_cover == found.clouds.FRACTIONAL_CLOUD_COVER_FOUR_OKTAS


def test_lanes_are_those_of_the_map_and_in_the_first_message_alone(truths: list[GroundTruth]) -> None:
    first, *others = truths
    assert not any(each.lane or each.lane_boundary for each in others)
    lanes = {each.id.value: each.classification for each in first.lane}
    boundaries = {each.id.value: each for each in first.lane_boundary}
    plain = {number: each for number, each in lanes.items() if each.type != Lane.Classification.TYPE_INTERSECTION}
    assert 10 < len(plain) < len(lanes)
    for number, lane in plain.items():
        (left,), (right,) = lane.left_lane_boundary_id, lane.right_lane_boundary_id
        lines = [
            np.array([[each.position.x, each.position.y] for each in boundaries[side.value].boundary_line])
            for side in (left, right)
        ]
        center = np.array([[point.x, point.y] for point in lane.centerline])
        np.testing.assert_allclose(center, (lines[0] + lines[1]) / 2, atol=1e-9)
        ahead = center[1] - center[0]
        aside = lines[0][0] - center[0]
        assert ahead[0] * aside[1] - ahead[1] * aside[0] > 0, "the left boundary is on the left"
        for other in (*lane.left_adjacent_lane_id, *lane.right_adjacent_lane_id):
            assert other.value in lanes
        if lane.type == Lane.Classification.TYPE_DRIVING:
            for pairing in lane.lane_pairing:
                assert number in _following(lanes, pairing.antecessor_lane_id.value)
    ids = [each.id.value for group in (first.lane, first.lane_boundary, first.moving_object) for each in group]
    ids += [each.id.value for group in (first.traffic_light, first.traffic_sign) for each in group]
    assert len(set(ids)) == len(ids)


def _following(lanes: Any, number: int) -> set[int]:
    return {pairing.successor_lane_id.value for pairing in lanes[number].lane_pairing}


def test_vehicles_are_described_and_nothing_is_of_an_unknown_kind(truths: list[GroundTruth]) -> None:
    """As the rules in OSI's files demand of ground truth."""
    for truth in truths[:2]:
        vehicles = [each for each in truth.moving_object if each.type == MovingObject.TYPE_VEHICLE]
        assert all(each.HasField("vehicle_attributes") for each in vehicles)
        assert list(_unknown(truth)) == []


def _unknown(message: Any) -> Iterator[str]:
    """Fields of a message with the value of an enumeration that means that it is unknown."""
    for field, value in message.ListFields():
        for each in value if field.is_repeated else [value]:
            if field.message_type is not None:
                yield from _unknown(each)
            elif field.enum_type is not None and field.enum_type.values_by_number[each].name.endswith("_UNKNOWN"):
                yield field.full_name


def test_the_command_reports_what_it_made(folder: Path, tmp_path: Path) -> None:
    words = ["export", "osi", str(folder / "set"), "--out", str(tmp_path / "out"), "--workers", "1"]
    first, second = (CliRunner().invoke(app, words, catch_exceptions=False).output for _ in range(2))
    assert f"{TICKS} messages of 1 scene in {tmp_path / 'out'}" in first and "1 scene was there already" in second


def test_tables_know_all_kinds() -> None:
    assert {*osi_names()["lines"]} == {paint.value for paint in Paint}
    assert {*osi_names()["lanes"]} == {kind.value for kind in LaneKind} - {"crossing", "walking_area"}
    assert objects.osi_names() is osi_names()


def test_without_the_simulator_there_are_no_lanes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/Blocks-0000", ticks=1)
    monkeypatch.setattr(osi_export, "load_extras", lambda: {"sim": Extra("sim", "the simulator", ("no_such_module",))})
    assert not export(tmp_path / "set/Blocks-0000", tmp_path / "out").has_lanes
    (truth,) = read(tmp_path / "out")
    assert not truth.lane and not truth.proj_string and truth.moving_object


def test_without_osi_python_the_command_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(osi_command, "find_spec", lambda name: None)
    monkeypatch.delenv("SIMBEV_COMMAND", raising=False)
    with pytest.raises(InputError, match=r"needs osi-python; .* -m pip install '\./exporters\[osi\]'"):
        osi_command.export_osi(tmp_path, tmp_path / "out")
    monkeypatch.setenv("SIMBEV_COMMAND", "./simbev")
    with pytest.raises(InputError, match=r"install it: \./simbev setup osi$"):
        osi_command.export_osi(tmp_path, tmp_path / "out")


def test_only_new_scenes_are_made(tmp_path: Path) -> None:
    for number in range(2):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-{number:04d}", number=number, ticks=2)
    done = export(tmp_path / "set", tmp_path / "out")
    assert (done.made, done.messages, done.failures) == (2, 4, {})
    before = digest(tmp_path / "out")
    (tmp_path / "out/.parts/Blocks-0001.osi.json").unlink()
    assert export(tmp_path / "set", tmp_path / "out").made == 1
    assert digest(tmp_path / "out") == before
    (tmp_path / "empty/scenes").mkdir(parents=True)
    with pytest.raises(InputError, match="no finished scene to export"):
        export(tmp_path / "empty", tmp_path / "out")


def test_a_roadside_unit_has_no_host_vehicle(tmp_path: Path) -> None:
    record_made_up(tmp_path / "set/Blocks-0000", with_agents(made_up_spec(SENSORS, ticks=1), roadside_unit("rsu")))
    export_osi(open_dataset(tmp_path / "set/Blocks-0000", threads=1).of_agent("rsu"), tmp_path / "out")
    (truth,) = read(tmp_path / "out")
    assert not truth.HasField("host_vehicle_id") and len(truth.moving_object) > 3
