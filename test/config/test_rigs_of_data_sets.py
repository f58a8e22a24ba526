"""Rigs of public data sets and presets of products fit the default ticks."""

from pathlib import Path

import pytest

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.load import load_scenario
from simbev_ros.config.presets import load_presets
from simbev_ros.config.radar import Radar

RIGS = Path(__file__).parents[2] / "config/rigs"


def scenario_with(rig: str, folder: Path):  # type: ignore[no-untyped-def]
    (folder / "set.yaml").write_text(f"scenes: [{{map: Blocks, train: 1}}]\nrig: {rig}\n")
    return load_scenario(str(folder / "set.yaml"))


@pytest.mark.parametrize(
    ("name", "counts"),
    [
        ("nuscenes", (6, 1, 5)),
        ("kitti", (2, 1, 0)),
        ("argoverse2", (9, 2, 0)),
        ("waymo", (5, 5, 0)),
        ("view_of_delft", (1, 1, 1)),
    ],
)
def test_rigs_have_the_sensors_of_their_data_sets(name: str, counts: tuple[int, int, int], tmp_path: Path) -> None:
    rig = scenario_with(str(RIGS / f"{name}.yaml"), tmp_path).rig
    assert tuple(len(rig.of_type(kind)) for kind in (Camera, Lidar, Radar)) == counts
    assert all(camera.imager is not None for camera in rig.of_type(Camera))


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        *(("camera", name) for name in load_presets("camera")),
        *(("lidar", name) for name in load_presets("lidar")),
        *(("radar", name) for name in load_presets("radar")),
    ],
)
def test_presets_fit_the_default_ticks(kind: str, name: str, tmp_path: Path) -> None:
    [sensor] = scenario_with(f"{{sensors: [{{type: {kind}, name: a, preset: {name}}}]}}", tmp_path).rig.sensors
    assert sensor.preset == name


def test_values_within_a_section_of_a_preset_can_be_changed_alone() -> None:
    known = load_presets("camera")["acA1600-60gc"]["imager"]
    product = {"type": "camera", "name": "a", "preset": "acA1600-60gc"}
    camera = Camera.model_validate({**product, "imager": {"blur_px": 1.5}})
    assert camera.imager is not None
    assert (camera.imager.blur_px, camera.imager.metered) == (1.5, known["metered"])
    plain = Camera.model_validate({**product, "imager": None})
    assert plain.imager is None
