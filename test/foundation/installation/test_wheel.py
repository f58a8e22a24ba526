"""The wheel has all that the commands need: installed elsewhere, without the checkout, it records a scene."""

import os
import shutil
import subprocess
import sys
import sysconfig
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow

REPOSITORY = Path(__file__).parents[3]
NOT_SOURCES = shutil.ignore_patterns(".*", "build", "out", "datasets", "*.egg-info", "__pycache__", "test")
SCENE = """
seed: 3
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 0.5, duration_s: 0.5}
rig:
  sensors:
    - {type: camera, name: cam_front, pose: {x_m: 0.6, z_m: 1.6}, width_px: 96, height_px: 64, rate_hz: 10}
    - {type: lidar, name: lidar, pose: {z_m: 1.8}, channels: 8, columns: 128}
traffic: {vehicles: 5, pedestrians: 5, spawn_radius_m: 100}
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(REPOSITORY, folder / "source", ignore=NOT_SOURCES)
    options = ["--no-deps", "--no-build-isolation", "--disable-pip-version-check", "--quiet"]
    command = [sys.executable, "-m", "pip", "wheel", *options, "-w", str(folder), str(folder / "source")]
    subprocess.run(command, check=True, capture_output=True, text=True)
    return next(folder.glob("*.whl"))


@pytest.fixture(scope="module")
def simbev(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[..., "subprocess.CompletedProcess[str]"]:
    """The command of a fresh virtual environment that has the wheel, and takes its requirements from this one."""
    folder = tmp_path_factory.mktemp("elsewhere")
    venv = folder / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(venv)], check=True)
    python = venv / "bin" / "python"
    pip = [sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--no-index", "--quiet"]
    subprocess.run([*pip, "--disable-pip-version-check", str(wheel)], check=True, capture_output=True, text=True)
    site = next((venv / "lib").glob("python3*/site-packages"))
    (site / "requirements.pth").write_text(sysconfig.get_path("purelib"))
    environment = {**os.environ, "COLUMNS": "200", "ROS_DOMAIN_ID": str(60 + os.getpid() % 38)}

    def run(*arguments: object) -> "subprocess.CompletedProcess[str]":
        command = [str(venv / "bin" / "simbev"), *map(str, arguments)]
        return subprocess.run(
            command, cwd=folder, env=environment, capture_output=True, text=True, timeout=200, check=False
        )

    return run


def test_the_wheel_holds_every_file_of_data(wheel: Path) -> None:
    data = {".yaml", ".glsl", ".css", ".onnx", ".typed", ".xml", ".msg", ".srv", ".action"}
    files = [path for path in REPOSITORY.joinpath("simbev_ros").rglob("*") if path.suffix in data]
    wanted = {path.relative_to(REPOSITORY).as_posix() for path in files}
    wanted |= {path.relative_to(REPOSITORY).as_posix() for path in REPOSITORY.joinpath("config").rglob("*.*ml")}
    interfaces = REPOSITORY.joinpath("interfaces").glob("*/*")
    wanted |= {path.relative_to(REPOSITORY).as_posix() for path in interfaces}
    held = {name.rpartition(".data/data/share/simbev_ros/")[2] for name in _names(wheel)}
    assert wanted - held == set()


def test_its_metadata_are_those_of_the_manifest(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        name = next(name for name in archive.namelist() if name.endswith("METADATA"))
        metadata = archive.read(name).decode()
    manifest = (REPOSITORY / "package.xml").read_text()
    version = metadata.split("\nVersion: ")[1].split("\n")[0]
    assert f"<version>{version}</version>" in manifest
    for field in ("Summary", "Maintainer-email", "License", "Keywords", "Project-URL", "Classifier"):
        assert f"\n{field}: " in metadata
    assert "# simbev_ros" in metadata.partition("\n\n")[2]


@pytest.mark.graph
def test_it_finds_nothing_missing_on_this_machine(
    simbev: Callable[..., "subprocess.CompletedProcess[str]"],
) -> None:
    answer = simbev("doctor")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert "rclpy from" in answer.stdout


@pytest.mark.graph
def test_it_records_a_scene(simbev: Callable[..., "subprocess.CompletedProcess[str]"], tmp_path: Path) -> None:
    (tmp_path / "short.yaml").write_text(SCENE)
    answer = simbev("generate", tmp_path / "short.yaml", "--out", tmp_path / "dataset")
    assert answer.returncode == 0, answer.stdout + answer.stderr
    assert simbev("verify", tmp_path / "dataset").returncode == 0


def _names(wheel: Path) -> list[str]:
    with zipfile.ZipFile(wheel) as archive:
        return archive.namelist()
