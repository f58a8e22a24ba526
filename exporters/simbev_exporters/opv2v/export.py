"""Exports a dataset to OPV2V's layout, which OpenCOOD reads: scenes with all their agents, in parallel.

A dataset enters; a folder with ``train``, ``validate`` and ``test`` leaves. In these each scene has a folder for each
agent, with the agent's files of all frames. A part of the work (``export.parts``) is one agent of one scene.
"""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from glob import escape
from pathlib import Path

from simbev_exporters.opv2v.connected_agents import ConnectedAgent, connected_agents, exported_ticks
from simbev_exporters.opv2v.frames import FrameSettings, Record, frame_files, motion_of, yaml_file
from simbev_exporters.recorded_sensors import recorded_cameras
from simbev_exporters.scene_parts import Failures, PartOfScene, Report, ignore_progress, make_missing
from simbev_ros import __version__
from simbev_ros.dataset import Dataset
from simbev_ros.dataset.frame_period import frame_period
from simbev_ros.dataset.parallel import OWN_PROCESS, Pool, report_step
from simbev_ros.export.parts import PARTS_FOLDER, fingerprint_of, hold_export, is_begun, remove_vanished
from simbev_ros.foundation.errors import BagError, InputError, foreign_content
from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.object_store.object_path import require_local
from simbev_ros.foundation.units import NS_PER_S

MAX_CAMERAS = 4

_FOLDERS = {"train": "train", "val": "validate", "test": "test"}
"""Folder of each split."""

_PROTOCOL = "data_protocol.yaml"


@dataclass(frozen=True, slots=True, kw_only=True)
class AgentPart(PartOfScene):
    """One agent of a scene as a part of the export. Its record contains the item ``frames``, their number.

    Attributes:
        folder: Name of the agent's folder.
        settings: Settings of the export.
    """

    folder: str
    settings: FrameSettings


@dataclass(frozen=True, slots=True)
class Exported:
    """Result of an export.

    Attributes:
        scenes: Number of scenes in the export.
        made: Number of scenes of which this run has exported something; the others were already there.
        agents: Number of agents of all scenes.
        frames: Number of frames of all agents of all scenes.
        cameras: Names of the cameras 0 to 3 and of those that are left out, for each agent of any scene.
        without_lidar: Number of scenes in which an agent is left out as it has no lidar, by name of the agent.
        many_stations: Names of the scenes with more than one roadside unit.
        failures: Reasons why scenes could not be exported, by name of the scene.
    """

    scenes: int
    made: int
    agents: int
    frames: int
    cameras: dict[str, tuple[dict[int, str], tuple[str, ...]]]
    without_lidar: dict[str, int]
    many_stations: tuple[str, ...]
    failures: Failures


def export_opv2v(
    dataset: Dataset,
    out: Path,
    settings: FrameSettings,
    *,
    pool: Pool = OWN_PROCESS,
    report: Report = ignore_progress,
) -> Exported:
    """Export the finished scenes of a dataset; scenes that are already in the folder and have not changed are kept.

    Args:
        dataset: The dataset.
        out: Folder of the export.
        settings: Settings of the export.
        pool: Workers that export agents.
        report: Called from time to time with the number of finished frames and the number of all frames to export.

    Raises:
        InputError: There is nothing to export, the folder cannot be written to or contains other data, another process
            writes into it, the rate does not divide that of the frames, or no agent has one of the cameras.
        SimbevError: A process was killed.
    """
    if not dataset.scenes:
        raise InputError(f"{dataset.path}: it has no finished scene to export")
    if not is_begun(out) and any((out / name).exists() for name in _FOLDERS.values()):
        raise InputError(f"{out}: it holds data of OPV2V's layout that simbev has not written; take another folder")
    agents, failures = _agents_by_scene(dataset, settings)
    parts = [_part(agent, out, settings) for of_scene in agents.values() for agent in of_scene]
    with hold_export(out):
        _remove_vanished(out, dataset, parts)
        missing, failed = make_missing(make_part, parts, pool, report, _frame_count)
        failures |= failed
        finished = {name: of_scene for name, of_scene in agents.items() if name not in failures}
        for of_scene in finished.values():
            _write_protocol(of_scene, out, settings)
        for scene in dataset.scenes:
            _remove_empty_folders(out, scene.name)
        with foreign_content(out / PARTS_FOLDER):
            frames = sum(part.finished_record()["frames"] for part in parts if part.scene.name in finished)
    return Exported(
        scenes=len(finished),
        made=len({part.scene.name for part in missing} & finished.keys()),
        agents=sum(map(len, finished.values())),
        frames=frames,
        cameras=_cameras(finished.values()),
        without_lidar=_without_lidar(finished.values()),
        many_stations=tuple(name for name, each in finished.items() if sum(a.folder.startswith("-") for a in each) > 1),
        failures=failures,
    )


def make_part(part: AgentPart) -> None:
    """Make the files of one agent of a scene, in any process; each frame is a step of parallel work.

    Raises:
        InputError: A file cannot be written.
        BagError: The bag is damaged, or the agents have no frame in common.
    """
    agents = connected_agents(part.scene, part.settings.cameras)
    agent = next(agent for agent in agents if agent.folder == part.folder)
    ticks, motion = exported_ticks(agents, part.settings.rate_hz).tolist(), motion_of(agent)
    folder = _folder(agent)
    part.begin()
    for tick in ticks:
        for end, content in frame_files(agent.scene[tick], agent, part.settings, motion).items():
            part.write(f"{folder}/{tick:06d}{end}", content)
        report_step()
    part.finish({"frames": len(ticks)})


def _agents_by_scene(dataset: Dataset, settings: FrameSettings) -> tuple[dict[str, list[ConnectedAgent]], Failures]:
    """Exported agents by name of the scene, and the reasons why scenes cannot be exported."""
    found: dict[str, list[ConnectedAgent]] = {}
    failures = {}
    for scene in dataset.scenes:
        try:
            agents = connected_agents(scene, settings.cameras)
            exported_ticks(agents, settings.rate_hz)
            found[scene.name] = agents
        except BagError as error:
            failures[scene.name] = str(error)
    known = {name for agents in found.values() for agent in agents for name in recorded_cameras(agent.scene)}
    unknown = sorted(set(settings.cameras or ()) - known)
    if unknown and found:
        raise InputError(
            f"no agent has images of {', '.join(unknown)}, but of {', '.join(sorted(known)) or 'no camera'}",
            parameter="cameras",
        )
    return found, failures


def _part(agent: ConnectedAgent, out: Path, settings: FrameSettings) -> AgentPart:
    scene = agent.scene
    bags = map(require_local, (scene.path, *scene.additional.values()))
    source = " ".join([scene.split, *map(fingerprint_of, bags)])
    chosen = {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(settings).items()}
    return AgentPart(
        out=out,
        name=f"{scene.name}.{agent.folder}",
        identity={"source": source, "agent": scene.agent, **chosen, "by": __version__},
        patterns=_patterns(scene.name, agent.folder),
        scene=scene,
        folder=agent.folder,
        settings=settings,
    )


def _frame_count(part: AgentPart) -> int:
    return len(range(0, len(part.scene), frame_period(part.scene, part.settings.rate_hz, "rate_hz")))


def _remove_vanished(out: Path, dataset: Dataset, parts: Sequence[AgentPart]) -> None:
    """Remove earlier parts of agents that scenes no longer have, as readers take every folder for an agent."""
    scenes = {scene.name for scene in dataset.scenes}

    def patterns_of(name: str) -> tuple[str, ...] | None:
        scene, _, folder = name.rpartition(".")
        return _patterns(scene, folder) if scene in scenes else None

    remove_vanished(out, [part.name for part in parts], patterns_of)


def _remove_empty_folders(out: Path, scene: str) -> None:
    """Remove a scene's folders without files of agents, which readers would take for scenes and agents."""
    for split in _FOLDERS.values():
        folder = path_inside(out, Path(split, scene))
        agents = [path for path in folder.glob("*") if path.is_dir()]
        for agent in agents:
            if not any(agent.iterdir()):
                agent.rmdir()
        if folder.exists() and not any(agent.exists() for agent in agents):
            (folder / _PROTOCOL).unlink(missing_ok=True)
            folder.rmdir()


def _write_protocol(agents: Sequence[ConnectedAgent], out: Path, settings: FrameSettings) -> None:
    """Write what a scene was made of, and the agent of each folder; readers of the layout do not need it."""
    scene = agents[0].scene
    spec = scene.spec
    record: Record = {
        "world": {
            "town": spec.map.name,
            "fixed_delta_seconds": spec.tick_ns / NS_PER_S,
            "weather": spec.weather.model_dump(mode="json"),
        },
        "scene": {"name": scene.name, "number": scene.number, "split": scene.split, "seed": spec.seed},
        "agents": {int(agent.folder): _about(agent) for agent in agents},
        "export": {"rate_hz": settings.rate_hz, "classes": list(settings.classes), "min_points": settings.min_points},
    }
    write_whole(path_inside(out, Path(_FOLDERS[scene.split], scene.name, _PROTOCOL)), yaml_file(record))


def _about(agent: ConnectedAgent) -> Record:
    vehicle = agent.scene.view.vehicle
    return {
        "name": agent.scene.agent,
        "carrier": "roadside unit" if vehicle is None else vehicle.blueprint,
        "lidar": agent.lidar,
        "cameras": {f"camera{number}": name for number, name in agent.cameras.items()},
    }


def _cameras(scenes: Iterable[Sequence[ConnectedAgent]]) -> dict[str, tuple[dict[int, str], tuple[str, ...]]]:
    """For each agent the exported cameras by number, and the recorded ones that are left out."""
    found: dict[str, tuple[dict[int, str], tuple[str, ...]]] = {}
    for agent in (agent for agents in scenes for agent in agents):
        left_out = [name for name in recorded_cameras(agent.scene) if name not in agent.cameras.values()]
        found.setdefault(agent.scene.agent, (agent.cameras, tuple(left_out)))
    return found


def _without_lidar(scenes: Iterable[Sequence[ConnectedAgent]]) -> dict[str, int]:
    names = [set(agents[0].scene.agents) - {agent.scene.agent for agent in agents} for agents in scenes]
    return dict(sorted(Counter(name for missing in names for name in missing).items()))


def _folder(agent: ConnectedAgent) -> str:
    """Path of an agent's folder, relative to the export."""
    return f"{_FOLDERS[agent.scene.split]}/{agent.scene.name}/{agent.folder}"


def _patterns(scene: str, folder: str) -> tuple[str, ...]:
    """Glob patterns of all files that an agent's part can have."""
    return tuple(f"{split}/{escape(scene)}/{escape(folder)}/*" for split in _FOLDERS.values())
