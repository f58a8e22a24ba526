"""An invalid configuration is refused with a message that names file, line, field and allowed values."""

import time
from pathlib import Path

import numpy as np
import pytest

from simbev_ros.cli.scene_options import SHIPPED
from simbev_ros.config.camera import Camera
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.geometry.camera import LensCamera, PinholeCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera

BASE = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: []}\n"


def rig(sensor: str) -> str:
    return f"scenes: [{{map: Blocks, train: 1}}]\nrig: {{sensors: [{sensor}]}}\n"


@pytest.mark.parametrize("name", SHIPPED.split(", "))
def test_shipped_configurations_load(name: str) -> None:
    assert load_scenario(name).rig.sensors


def test_the_paper_rig_has_the_poses_and_lidar_of_the_paper() -> None:
    sensors = {sensor.name: sensor for sensor in load_scenario("paper").rig.sensors}
    pose = sensors["cam_back_left"].pose
    assert (pose.x_m, pose.y_m, pose.z_m, pose.yaw_deg) == (0.0, 0.4, 1.6, 110)
    assert sensors["lidar"].channels * sensors["lidar"].columns * 20 == 5_242_880


def test_sensor_defaults_of_the_rig_file_reach_every_sensor_of_their_type() -> None:
    assert {camera.width_px for camera in load_scenario("demo").rig.sensors if camera.type == "camera"} == {800}


def test_intrinsics_come_from_a_focal_length_or_a_field_of_view() -> None:
    camera = Camera(type="camera", name="a", width_px=640, height_px=480, fx_px=500, cy_px=250)
    assert camera.model == PinholeCamera(640, 480, 500.0, 500.0, 319.5, 250.0)
    bent = Camera(type="camera", name="a", distortion=(-0.2, 0.03, 0.001, 0.0, 0.0))
    wide = Camera(type="camera", name="a", horizontal_fov_deg=80)
    assert isinstance(bent.model, LensCamera) and not isinstance(wide.model, LensCamera)
    assert np.array_equal(bent.model.matrix, wide.model.matrix)
    assert bent.model.distortion == bent.distortion
    assert Camera.model_validate(bent.model_dump(mode="json")) == bent


def test_a_fisheye_comes_from_a_field_of_view_or_a_focal_length() -> None:
    given = {"type": "camera", "name": "a", "width_px": 640, "height_px": 640, "distortion_model": "equidistant"}
    wide = Camera.model_validate({**given, "horizontal_fov_deg": 190, "distortion": [0.02, 0.0, 0.0, 0.001]})
    assert isinstance(wide.model, FisheyeCamera) and not isinstance(wide.model, LensCamera)
    edges = wide.model.rays(np.array([[-0.5, 319.5], [639.5, 319.5]]))
    assert np.degrees(np.arccos(edges[0] @ [0, 0, 1])) == pytest.approx(95.0)
    assert edges[0] * [-1, 1, 1] == pytest.approx(edges[1])
    assert np.isnan(wide.model.rays(np.array([[0.0, 0.0]]))).all()
    assert Camera.model_validate(wide.model_dump(mode="json")) == wide
    narrow = Camera.model_validate({**given, "fx_px": 300, "cy_px": 300, "image_circle_deg": 170})
    assert narrow.model == FisheyeCamera(640, 640, 300.0, 300.0, 319.5, 300.0, (0.0,) * 4, np.radians(85.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            BASE + "time: {duration: 4}",
            r"x.yaml:3: time.duration: unknown key; did you mean duration_s\? allowed: tick_s",
        ),
        (BASE + "time: {duration_s: 4 s}", r"x.yaml:3: time.duration_s: .*valid number.*'4 s'"),
        (BASE + "time:\n  duration_s: -4", r"x.yaml:4: time.duration_s: is -4, but 0.001 to 3000 is allowed"),
        (BASE + "time: {tick_s: 0.0125}", r"x.yaml:3: time.tick_s: 0.0125 is neither whole milliseconds nor 1/n s"),
        (BASE + "time: {duration_s: 4.01}", "4.01 is not a whole number of ticks of 0.05 s"),
        (BASE + "weather: {cloudiness: 200}", r"weather.cloudiness: is 200, but 0 to 100 is allowed"),
        (BASE + "weather: {cloudiness: {uniform: [0, 200]}}", "draws from 0 to 200, but 0 to 100 is allowed"),
        (BASE + "weather: {cloudiness: {uniform: [0, 9], beta: [1, 2]}}", "exactly one of .* found uniform and beta"),
        (BASE + "weather: {fog_falloff: .nan}", "weather.fog_falloff: .*finite number"),
        (BASE + "traffic: {min_gap_m: {normal: [3, 1]}}", "bound it with min and max"),
        (rig("{type: camera, name: a}, {type: lidar, name: a}"), "two sensors are named a; names must be unique"),
        (rig("{type: camera, name: a, pose: {x: 3}}"), r"rig.sensors\[0\].pose.x: unknown key; did you mean x_m\?"),
        (rig("{type: camera, name: a, rate_hz: 30}"), r"\(only .*\); with time.tick_s 0.0166667 both rates fit"),
        (rig("{type: camera, name: a, rate_hz: 7}"), "sensor a: rate_hz 7 does not divide the tick rate 20 Hz"),
        (
            rig("{type: gnss, name: a, rate_hz: 100}"),
            r"20 Hz; allowed are 20, .*only an imu can be faster",
        ),
        (
            rig("{type: imu, name: a, rate_hz: 125}"),
            r"125 neither divides the tick rate 20 Hz nor .* and 40, 60",
        ),
        (
            rig("{type: imu, name: a, gyroscope_bias_radps: [0, 1]}"),
            r"is \[0, 1\], but a number for all axes or",
        ),
        (rig("{type: imu, name: a, gyroscope_bias_radps: [0, 11, 0]}"), r"_bias_radps\[1\]: .* equal to 10, not 11"),
        (rig("{type: gnss, name: a, dropout_share: 1}"), r"dropout_share: .*less than or equal to 0.99, not 1"),
        (rig("{type: camera, name: a, fx_px: 900, horizontal_fov_deg: 70}"), "horizontal_fov_deg and fx_px are set"),
        (rig("{type: camera, name: a, cx_px: 300}"), "cx_px without fx_px"),
        (rig("{type: camera, name: a, distortion: [1, 2]}"), r"\[0\]: distortion: has 2 coefficients; plumb_bob takes"),
        (rig("{type: camera, name: a, modalities: [radar]}"), r"\.yaml:\d+: [^\n]*modalities\[0\]: 'radar' .*'raw'$"),
        (rig("{type: camera, name: a, video: h264, modalities: [depth]}"), "video: needs the modality rgb"),
        (rig("{type: camera, name: a, video: h264, width_px: 801}"), "video: 801 x 900 pixels; H.264 needs even"),
        (
            rig("{type: camera, name: a, horizontal_fov_deg: 190}"),
            r"is 190; from 170 on, it needs distortion_model: equi",
        ),
        (rig("{type: camera, name: a, image_circle_deg: 190}"), r"image_circle_deg: only for distortion_model: equi"),
        (
            rig("{type: camera, name: a, distortion_model: equidistant}"),
            r"equidistant needs horizontal_fov_deg or fx_px",
        ),
        (
            rig("{type: camera, name: a, distortion_model: equidistant, fx_px: 400, distortion: [0, 0, 0, 0, 0]}"),
            r"distortion: has 5 coefficients; equidistant takes k1, k2, k3, k4",
        ),
        (
            rig("{type: camera, name: a, distortion_model: equidistant, fx_px: 400, distortion: [-0.2, 0, 0, 0]}"),
            r"k1, k2, k3, k4 -0.2, 0, 0, 0: the radius .* only up to 73\.\d+°, .* take an image circle of at most 147",
        ),
        (
            rig("{type: camera, name: a, distortion_model: equidistant, horizontal_fov_deg: 190, image_circle_deg: 9}"),
            r"image_circle_deg: is 9, but horizontal_fov_deg is 190",
        ),
        (
            rig("{type: camera, name: a, distortion_model: equidistant, fx_px: 400, imager: {shutter: {}}}"),
            "imager.shutter: not with distortion_model: equidistant",
        ),
        (rig("{type: camera, name: a, fx_px: 20}"), r"fx_px 20, fy_px 20: .* 1600 x 900 .* more than 85°"),
        (
            rig("{type: camera, name: a, distortion: [-0.9, 0, 0, 0, 0]}"),
            r"x.yaml:2: rig.sensors\[0\]: distortion: k1 -0.9, .* cannot be inverted over the whole image",
        ),
        (rig("{type: camera, name: a, exposure: {iso: 100}}"), "iso is set, time_s is not: give both"),
        (
            rig("{type: camra, name: a}"),
            r"x.yaml:2: rig.sensors\[0\].type: 'camra' is not known; did you mean camera\? allowed: camera, lidar, ",
        ),
        (rig("{type: sonar, name: a}"), r"rig.sensors\[0\].type: 'sonar' is not known; allowed: camera, lidar, "),
        (rig("{name: a}"), r"x.yaml:2: rig.sensors\[0\].type: is missing; allowed: camera, lidar, radar, "),
        (
            rig("{type: camera, name: a, modalities: [depht]}"),
            r"x.yaml:2: rig.sensors\[0\].modalities\[0\]: 'depht' is not known; did you mean depth\? allowed: 'rgb', ",
        ),
        (rig("{type: camera, name: a, noise: {full_well: 9}}"), r"did you mean full_well_electrons\? allowed"),
        (rig("{type: camera, name: A b}"), r"rig.sensors\[0\].name: .*pattern"),
        (BASE + "graph: {participants: ['a:b']}", r"graph.participants\[0\]: .*pattern .* not 'a:b'"),
        ("rig: {sensors: []}", "scenes: is missing"),
        (BASE.replace("train: 1", "train: 0"), "all counts are 0"),
        ("rig: rigs/none.yaml\n" + BASE.splitlines()[0], "rig: no such file"),
        (BASE + "seed: 1\nseed: 2", "key seed appears twice"),
        ("a: [", "not valid YAML"),
        ("- 1", "must be a mapping of sections"),
        ("", "must be a mapping of sections"),
        ("a: &a [*a]", "an alias refers to what it is part of"),
        ("x: !!python/object/apply:os.system [true]", "not valid YAML"),
    ],
)
def test_bad_input_is_refused_with_a_clear_message(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "x.yaml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        load_scenario(path)


def test_yaml_bomb_is_refused_before_it_expands(tmp_path: Path) -> None:
    lines = ["a: &a [1,1,1,1,1,1,1,1,1,1]"]
    lines += [f"{chr(98 + i)}: &{chr(98 + i)} [{','.join(['*' + chr(97 + i)] * 10)}]" for i in range(20)]
    path = tmp_path / "bomb.yaml"
    path.write_text("\n".join(lines))
    with pytest.raises(InputError, match="expands to more than"):
        load_scenario(path)


def test_missing_file_lists_the_shipped_configurations() -> None:
    with pytest.raises(InputError, match=f"no such file; shipped configurations are {SHIPPED}$"):
        load_scenario("nowhere.yaml")


def test_error_in_a_rig_file_names_the_rig_file_and_its_line(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text("sensors:\n  - type: lidar\n    name: top\n    channels: 0\n")
    path = tmp_path / "x.yaml"
    path.write_text("scenes: [{map: Blocks, train: 1}]\nrig: rig.yaml\n")
    with pytest.raises(InputError, match=r"rig.yaml:4: sensors\[0\].channels: .*greater than or equal to 1, not 0"):
        load_scenario(path)


def test_of_thousands_of_errors_the_first_fifty_are_explained(tmp_path: Path) -> None:
    path = tmp_path / "many.yaml"
    path.write_text(BASE + "".join(f"key{number}: 1\n" for number in range(3000)))
    started_s = time.process_time()
    with pytest.raises(InputError) as raised:
        load_scenario(path)
    assert time.process_time() - started_s < 10  # an explanation each would take a minute
    lines = str(raised.value).splitlines()
    assert len(lines) == 51 and lines[-1] == f"{path}: and 2,950 more errors"


def test_a_folder_does_not_hide_a_shipped_configuration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "demo").mkdir()
    monkeypatch.chdir(tmp_path)
    assert load_scenario("demo").seed == 102
    (tmp_path / "other").mkdir()
    with pytest.raises(InputError, match=r"^other: is not a file$"):
        load_scenario("other")
