"""Tests of Autoware's description packages: they have the rig's extrinsics and the measures of the vehicle."""

import shutil
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import yaml
from made_up_scene import SENSORS, made_up_spec, record_made_up
from nuscenes_tables import digest
from scipy.spatial.transform import Rotation
from several_agents import car, roadside_unit, with_agents
from typer.testing import CliRunner

from simbev_exporters.autoware.export import export_packages
from simbev_ros.cli.main import app
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rig import Rig
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.recording.layout import locate_mcap
from simbev_ros.scene.blueprints import blueprint_named

CONFIG = """
scenes: [{map: Blocks, train: 1}]
ego: {blueprint: vehicle.box_truck}
rig:
  agent: truck
  sensors:
    - {type: camera, name: cam, pose: {x_m: 2.0, y_m: 0.4, z_m: 2.2, yaw_deg: 30, pitch_deg: 5}}
    - {type: lidar, name: roof, pose: {x_m: 1.0, y_m: -0.2, z_m: 3.6, yaw_deg: 90}}
    - {type: lidar, name: rear, pose: {x_m: -4.0, z_m: 1.0, yaw_deg: 180, roll_deg: 3}}
    - {type: imu, name: imu, pose: {z_m: 0.5}}
"""


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the configuration and, in ``out``, its packages."""
    folder = tmp_path_factory.mktemp("autoware")
    (folder / "my.yaml").write_text(CONFIG)
    names = [path.name for path in export_packages(str(folder / "my.yaml"), folder / "out", "big")]
    assert names == ["big_sensor_kit_description", "big_vehicle_description"]
    return folder


@pytest.fixture(scope="module")
def rig(source: Path) -> Rig:
    return load_scenario(source / "my.yaml").rig


def read(file: Path) -> Any:
    return yaml.safe_load(file.read_text())


def matrix(values: dict[str, float]) -> Float64Array:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", [values[name] for name in ("roll", "pitch", "yaw")]).as_matrix()
    pose[:3, 3] = [values[name] for name in "xyz"]
    return pose


def test_measures_are_those_of_the_vehicle(source: Path) -> None:
    info = read(source / "out/big_vehicle_description/config/vehicle_info.param.yaml")["/**"]["ros__parameters"]
    truck = blueprint_named("vehicle.box_truck")
    length_m, width_m, height_m = truck.size_m
    assert info["wheel_base"] + info["front_overhang"] + info["rear_overhang"] == pytest.approx(length_m, abs=1e-3)
    assert info["wheel_tread"] + info["left_overhang"] + info["right_overhang"] == pytest.approx(width_m, abs=1e-3)
    assert info["vehicle_height"] == pytest.approx(height_m) and info["wheel_radius"] == truck.wheel_radius_m
    assert info["wheel_base"] == truck.wheelbase_m and 0.2 < info["wheel_width"] < 0.4 < info["max_steer_angle"] < 0.8
    assert 0.7 * width_m < info["wheel_tread"] < width_m


def test_calibrations_are_the_rigs_about_the_rear_axle(source: Path, rig: Rig) -> None:
    config = source / "out/big_sensor_kit_description/config"
    base_from_kit = matrix(read(config / "sensors_calibration.yaml")["base_link"]["sensor_kit_base_link"])
    found = read(config / "sensor_kit_calibration.yaml")["sensor_kit_base_link"]
    assert list(found) == ["truck/cam", "truck/roof", "truck/rear", "truck/imu"]
    assert {found["truck/roof"][axis] for axis in "xyz"} == {0.0}, "the kit is at the first lidar"
    axle_m = blueprint_named("vehicle.box_truck").wheelbase_m / 2
    for sensor in rig.sensors:
        expected = sensor.pose.ego_from_sensor.copy()
        expected[0, 3] += axle_m
        np.testing.assert_allclose(base_from_kit @ matrix(found[f"truck/{sensor.name}"]), expected, atol=1e-6)


def test_xacro_reads_the_description(source: Path, rig: Rig, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    xacro = pytest.importorskip("xacro")
    index = tmp_path / "share/ament_index/resource_index/packages"
    index.mkdir(parents=True)
    for package in (source / "out").iterdir():
        shutil.copytree(package, tmp_path / "share" / package.name)
        (index / package.name).touch()
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    (tmp_path / "all.xacro").write_text(
        '<robot name="all" xmlns:xacro="http://ros.org/wiki/xacro">'
        '<xacro:include filename="$(find big_vehicle_description)/urdf/vehicle.xacro"/>'
        '<xacro:include filename="$(find big_sensor_kit_description)/urdf/sensors.xacro"/></robot>'
    )
    robot = ElementTree.fromstring(xacro.process_file(str(tmp_path / "all.xacro")).toxml())
    poses: dict[str, Float64Array] = {"base_link": np.eye(4)}
    for joint in robot.iter("joint"):
        parent, child, origin = (joint.find(tag) for tag in ("parent", "child", "origin"))
        assert parent is not None and child is not None and origin is not None
        numbers = [float(word) for name in ("xyz", "rpy") for word in origin.attrib[name].split()]
        own = matrix(dict(zip(("x", "y", "z", "roll", "pitch", "yaw"), numbers, strict=True)))
        poses[child.attrib["link"]] = poses[parent.attrib["link"]] @ own
    assert {link.attrib["name"] for link in robot.iter("link")} == poses.keys()
    base_from_ego = poses["vehicle_body"]
    for sensor in rig.sensors:
        expected = base_from_ego @ sensor.pose.ego_from_sensor
        np.testing.assert_allclose(poses[f"truck/{sensor.name}"], expected, atol=1e-6)
    ahead = poses["truck/cam_optical"][:3, 2]
    np.testing.assert_allclose(ahead, poses["truck/cam"][:3, 0], atol=1e-6, err_msg="the optical z axis looks ahead")
    assert len(list(robot.iter("visual"))) > 10


def test_packages_name_themselves(source: Path) -> None:
    for name in ("big_vehicle_description", "big_sensor_kit_description"):
        package = ElementTree.parse(source / "out" / name / "package.xml").getroot()
        assert package.findtext("name") == name and package.findtext("export/build_type") == "ament_cmake"
        assert f"project({name})" in (source / "out" / name / "CMakeLists.txt").read_text()


def test_a_bag_describes_any_of_its_vehicles(tmp_path: Path) -> None:
    spec = with_agents(made_up_spec(SENSORS, ticks=1), car("second", 1), roadside_unit("rsu"))
    record_made_up(tmp_path / "set/scenes/train/Blocks-0000", spec)
    source = str(tmp_path / "set")
    export_packages(source, tmp_path / "first", "a")
    export_packages(source, tmp_path / "second", "b", "second")
    export_packages(str(locate_mcap(tmp_path / "set/scenes/train/Blocks-0000")), tmp_path / "file", "a")
    assert digest(tmp_path / "file") == digest(tmp_path / "first")
    first, second = (
        read(tmp_path / path / "config/sensor_kit_calibration.yaml")["sensor_kit_base_link"]
        for path in ("first/a_sensor_kit_description", "second/b_sensor_kit_description")
    )
    assert "ego/lidar" in first and all(name.startswith("second/") for name in second)
    for agent, message in (("rsu", "roadside unit"), ("third", "has ego, second, rsu, not 'third'")):
        with pytest.raises(InputError, match=message):
            export_packages(source, tmp_path / "other", "c", agent)
    assert not (tmp_path / "other").exists()


def test_the_command_names_the_packages(source: Path, tmp_path: Path) -> None:
    words = ["export", "autoware", str(source / "my.yaml"), "--out", str(tmp_path)]
    output = CliRunner().invoke(app, words, catch_exceptions=False).output
    names = ("simbev_sensor_kit_description", "simbev_vehicle_description")
    assert output == "".join(f"{tmp_path / name}\n" for name in names)


def test_bad_input_is_explained(source: Path, tmp_path: Path) -> None:
    config = str(source / "my.yaml")
    with pytest.raises(InputError, match="big_sensor_kit_description exists; remove it"):
        export_packages(config, source / "out", "big")
    with pytest.raises(InputError, match=r"name: 'Big-1' must begin with a letter"):
        export_packages(config, tmp_path, "Big-1")
    with pytest.raises(InputError, match="agent: of a configuration only the first agent, truck, is described"):
        export_packages(config, tmp_path, "big", "second")
    for name in ("vehicle.ship", "trailer.semi", "pedestrian.man.suit.balding"):
        (tmp_path / "wrong.yaml").write_text(CONFIG.replace("vehicle.box_truck", name))
        with pytest.raises(InputError, match=f"there is no vehicle '{name}'"):
            export_packages(str(tmp_path / "wrong.yaml"), tmp_path, "big")


def test_a_bag_with_an_unknown_vehicle_is_refused(tmp_path: Path) -> None:
    spec = made_up_spec([])
    vehicles = (spec.vehicles[0].model_copy(update={"blueprint": "vehicle.ship"}), *spec.vehicles[1:])
    record_made_up(tmp_path / "bag", spec.model_copy(update={"vehicles": vehicles}))
    with pytest.raises(InputError, match=r"there is no vehicle 'vehicle\.ship'"):
        export_packages(str(tmp_path / "bag"), tmp_path, "big")
