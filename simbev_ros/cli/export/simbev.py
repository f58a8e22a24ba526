"""``simbev export simbev``: writes a dataset in the layout of SimBEV."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.cli.agent_option import ExportedAgentOption, exported_agents
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Ray, Workers, open_pool, shared_path
from simbev_ros.dataset.parallel import Pool
from simbev_ros.foundation.counts import plural

if TYPE_CHECKING:
    from simbev_ros.dataset import Dataset
    from simbev_ros.export.simbev.export import FramesPart

_MODULE, _MEMORY_MIB = "simbev_ros.export.simbev.export", 1024


def export_simbev(
    dataset: Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder in which the folder simbev is made.", show_default=False)],
    absolute_paths: Annotated[
        bool,
        typer.Option(
            "--absolute-paths",
            help="Absolute paths in infos/*.json, as SimBEV's own tools expect, not relative to the folder simbev.",
        ),
    ] = False,
    agent: ExportedAgentOption = None,
    workers: Workers = None,
    ray: Ray = None,
) -> None:
    """Write finished scenes in the layout of SimBEV: sweeps, ground truth, infos.

    After Ctrl-C or a crash the same command continues where it stopped; of a dataset that has grown only new scenes are
    written. The infos are rewritten each time, so the same command with or without --absolute-paths changes only
    these, and after an export with absolute paths was moved, it corrects them.

    [bold]Examples[/]

    simbev export simbev datasets/first --out exported

    simbev export simbev datasets/first --out exported --absolute-paths

    simbev export simbev datasets/several --out exported --agent all

    simbev export simbev /shared/datasets/first --out /shared/exported --ray auto
    """
    from simbev_ros.dataset import open_dataset
    from simbev_ros.export.simbev.export import ROOT

    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    pooled = open_pool(workers, ray, module=_MODULE, memory_mib=_MEMORY_MIB, reads=[dataset], writes=[out])
    with pooled as pool:
        for seen, folder in exported_agents(opened, agent, out):
            _export(seen, folder / ROOT, pool, absolute_paths=absolute_paths)


def _export(opened: "Dataset", root: Path, pool: Pool, *, absolute_paths: bool) -> None:
    """Export what one agent sees, and print what was made."""
    from simbev_ros.export.parts import hold_export
    from simbev_ros.export.simbev.export import finish, parts_of, remove_ends

    with hold_export(root):
        parts = parts_of(opened, root)
        remove_ends(parts)
        made = _make(parts, pool)
        missing = finish(opened, parts, absolute_paths=absolute_paths)
    console, frames = make_console(), sum(part.count for part in parts)
    scenes = plural(len(opened.scenes), "scene")
    console.print(f"{frames} frames of {scenes} in {root}", highlight=False)
    if made < frames:
        console.print(f"{frames - made} of them were there already", highlight=False)
    for line in missing:
        console.print(line, style="dim", highlight=False)


def _make(parts: "list[FramesPart]", pool: Pool) -> int:
    """Make the missing parts and return the number of their frames."""
    from simbev_ros.export.simbev.export import make_part

    todo = [part for part in parts if part.record() is None]
    frames = sum(part.count for part in todo)
    with counting_bar("frames", make_console(stderr=True), frames) as bar:
        for count in pool.map(make_part, todo):
            bar.advance(count)
    return frames
