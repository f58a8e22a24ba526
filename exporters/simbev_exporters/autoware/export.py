"""Writes Autoware's description packages of a configuration, or of the scene of a bag.

The entry point of ``simbev export autoware``: a configuration or a dataset enters; folders of packages leave.
"""

import re
from pathlib import Path

from simbev_exporters.autoware.packages import description_packages
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rig import Rig
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.scene.blueprints import Blueprint, blueprint_index, blueprint_named

_NAME = re.compile(r"[a-z][a-z0-9_]*")


def export_packages(source: str, out: Path, name: str, agent: str | None = None) -> list[Path]:
    """Write the packages; none may exist.

    Args:
        source: Path or name of a configuration; or a dataset, or a bag, whose first scene is described.
        out: Folder of the packages, such as ``src`` of a workspace.
        name: Begin of the packages' names.
        agent: Name of the agent of a scene; None: the first one, the only one that a configuration can describe.

    Returns:
        The folders of the packages.

    Raises:
        InputError: The configuration is invalid, the agent is missing or not a vehicle, a package cannot have the
            name, or exists, or a file cannot be written.
        BagError: The bag is damaged.
    """
    if not _NAME.fullmatch(name):
        raise InputError(
            f"{name!r} must begin with a letter and have lower-case letters, digits and '_'", parameter="name"
        )
    files = description_packages(*_carrier(source, agent), name)
    folders = sorted({out / Path(path).parts[0] for path in files})
    for folder in folders:
        if folder.exists():
            raise InputError(f"{folder} exists; remove it, or choose another --name or --out")
    for path, content in files.items():
        with write_errors(out / path):
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            write_whole(out / path, content)
    return folders


def _carrier(source: str, agent: str | None) -> tuple[Rig, Blueprint]:
    """The rig and the vehicle that carries it."""
    if Path(source).is_dir() or Path(source).suffix == ".mcap":
        return _recorded_carrier(Path(source), agent)
    scenario = load_scenario(source)
    if agent not in (None, scenario.rig.agent):
        raise InputError(
            f"of a configuration only the first agent, {scenario.rig.agent}, is described", parameter="agent"
        )
    return scenario.rig, _vehicle(source, scenario.ego.blueprint)


def _recorded_carrier(source: Path, agent: str | None) -> tuple[Rig, Blueprint]:
    dataset = open_dataset(source, threads=1)
    if not dataset.scenes:
        raise InputError(f"{source}: it has no finished scene")
    scene = dataset.scenes[0]
    if agent is not None and agent not in scene.agents:
        raise InputError(f"{scene.path} has {', '.join(scene.agents)}, not {agent!r}", parameter="agent")
    view = (scene if agent is None else scene.of_agent(agent)).view
    if view.vehicle is None:
        raise InputError(f"{view.agent} is a roadside unit, which no vehicle carries", parameter="agent")
    return view.rig, _vehicle(scene.path, view.vehicle.blueprint)


def _vehicle(source: object, name: str) -> Blueprint:
    if name not in blueprint_index() or blueprint_named(name).kind != "vehicle":
        raise InputError(f"{source}: there is no vehicle {name!r}")
    return blueprint_named(name)
