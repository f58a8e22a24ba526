"""``simbev export opv2v``: writes a dataset of scenes with several agents in the layout of OPV2V."""

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_exporters.cli.words import different_words
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Ray, Workers, open_pool, shared_path
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.semantics import MOTOR_CLASSES, MOVING_CLASSES

if TYPE_CHECKING:
    from simbev_exporters.opv2v.export import Exported

_MODULE, _MEMORY_MIB = "simbev_exporters.opv2v.export", 1024


def export_opv2v(
    dataset: Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder in which train, validate and test are made.", show_default=False)],
    rate_hz: Annotated[float, typer.Option(help="Number of frames per second.", min=0.01, max=1000)] = 10.0,
    classes: Annotated[
        str,
        typer.Option(
            help=f"Classes of vehicles, with commas between; allowed: {', '.join(MOVING_CLASSES)}.", metavar="NAMES"
        ),
    ] = ",".join(MOTOR_CLASSES),
    points: Annotated[int, typer.Option(help="Minimum number of an agent's lidar points in a vehicle.", min=0)] = 1,
    cameras: Annotated[
        str | None,
        typer.Option(
            help="Cameras 0 to 3, with commas between; by default by their directions: front, right, left, back.",
            metavar="NAMES",
            show_default=False,
        ),
    ] = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write finished scenes in the layout of OPV2V, with all agents that have a lidar, for OpenCOOD and its relatives.

    Folders of agents are ids: those of vehicles are positive, as in the boxes of the others; roadside units have -1 and
    so on. Coordinates are CARLA's, with y to the right.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written.

    [bold]Examples[/]

    simbev export opv2v datasets/several --out exported

    simbev export opv2v datasets/several --out exported --cameras cam_front,cam_right,cam_left,cam_back --points 5
    """
    from simbev_exporters.opv2v.export import MAX_CAMERAS, export_opv2v
    from simbev_exporters.opv2v.frames import FrameSettings
    from simbev_ros.dataset import open_dataset

    chosen = None if cameras is None else different_words("cameras", cameras)
    if chosen is not None and len(chosen) > MAX_CAMERAS:
        raise InputError(f"{cameras!r} are {len(chosen)}; the layout has {MAX_CAMERAS}", parameter="cameras")
    wanted = different_words("classes", classes)
    for name in wanted:
        if name not in MOVING_CLASSES:
            raise InputError(f"there is no {name!r}; allowed: {', '.join(MOVING_CLASSES)}", parameter="classes")
    settings = FrameSettings(rate_hz=rate_hz, classes=wanted, min_points=points, cameras=chosen)
    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    pooled = open_pool(workers, ray, module=_MODULE, memory_mib=_MEMORY_MIB, reads=[dataset], writes=[out])
    with pooled as pool, counting_bar("frames", make_console(stderr=True), elapsed=True) as bar:
        done = export_opv2v(opened, out, settings, pool=pool, report=bar.show)
    console = make_console(soft_wrap=True, highlight=False)
    for line in _lines(done, out):
        console.print(line)
    for reason in done.failures.values():
        console.print(reason, style="red")
    if done.failures:
        raise SimbevError(f"{len(done.failures)} of {plural(len(opened.scenes), 'scene')} could not be exported")


def _lines(done: "Exported", out: Path) -> Iterator[str]:
    """Lines of text that say what was made and what is missing."""
    yield f"{plural(done.frames, 'frame')} of {plural(done.agents, 'agent')} in {plural(done.scenes, 'scene')} in {out}"
    there = done.scenes - done.made
    if there:
        yield f"{plural(there, 'scene')} {'was' if there == 1 else 'were'} there already"
    agents_by_cameras = defaultdict(list)
    for agent, (cameras, left_out) in done.cameras.items():
        words = ", ".join(f"{number} {name}" for number, name in cameras.items()) or "none"
        more = f"; left out: {', '.join(left_out)}" if left_out else ""
        agents_by_cameras[words + more].append(agent)
    for words, agents in agents_by_cameras.items():
        yield f"cameras of {', '.join(agents)}: {words}"
    for agent, count in done.without_lidar.items():
        yield f"{agent} is left out of {plural(count, 'scene')}: it has no lidar"
    if done.many_stations:
        yield (
            f"{plural(len(done.many_stations), 'scene')} with more than one roadside unit, of which OpenCOOD takes one "
            f"for the ego: {', '.join(done.many_stations[:5])}{' …' if len(done.many_stations) > 5 else ''}"
        )
