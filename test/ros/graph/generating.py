"""A small dataset, and the command that makes it."""

from pathlib import Path

from commands import Simbev

from simbev_ros.foundation.object_store.object_path import AnyPath

CONFIG = """
seed: 5
scenes: [SCENES]
time: {warm_up_s: 1, duration_s: 0.5}
rig:
  sensors:
    - {type: lidar, name: lidar, pose: {z_m: 1.8}, channels: 8, columns: 128}
    - {type: gnss, name: gnss}
weather: {cloudiness: 20, precipitation: 0, sun_altitude_deg: 45, fog_density: 0}
traffic: {vehicles: 8, pedestrians: 8, spawn_radius_m: 100}
annotation: {bev: {rows: 60, columns: 60}}
"""


def write(folder: Path, scenes: str, *, has_lidar: bool = True) -> Path:
    """Write a configuration; without the lidar, whose process takes the longest to start, it needs four processes."""
    path = folder / "generate.yaml"
    lines = CONFIG.replace("SCENES", scenes).splitlines(keepends=True)
    path.write_text("".join(line for line in lines if has_lidar or "type: lidar" not in line))
    return path


def files(dataset: Path) -> dict[str, bytes]:
    return {str(path.relative_to(dataset)): path.read_bytes() for path in sorted(dataset.glob("scenes/*/*/*.mcap"))}


def generate(simbev: Simbev, config: Path, dataset: AnyPath, *more: object) -> str:
    code, output = simbev("generate", config, "--out", dataset, *more).finish(600)
    assert code == 0, output
    return output
