"""How a command exports a dataset with a pool of workers: agent by agent, with progress and a result in words."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console

from simbev_ros.cli.agent_option import exported_agents
from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import open_pool, shared_path
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError, SimbevError

if TYPE_CHECKING:
    from simbev_ros.dataset import Dataset


def export_agents(
    dataset: Path,
    out: Path,
    agent: str | None,
    workers: str | None,
    ray: str | None,
    *,
    module: str,
    memory_mib: int,
    unit: str,
    export: "Callable[[Dataset, Path, Any, Callable[..., None]], Any]",
    report: Callable[[Any, Path, Console], None],
) -> None:
    """Export what the agents have recorded, and print what was made.

    Args:
        dataset: The dataset.
        out: Folder of the export.
        agent: Value of --agent.
        workers: Value of --workers.
        ray: Value of --ray.
        module: Module that the workers import.
        memory_mib: Memory of a worker.
        unit: What the progress counts.
        export: Exports a dataset as one agent sees it, given the folder, the pool and a function for the progress. Its
            result has the numbers of all ``scenes`` and of those ``made`` now, and ``failures`` by scene.
        report: Prints the other lines of a result, given the folder.

    Raises:
        InputError: No scene could be exported.
        SimbevError: Some could not.
    """
    from simbev_ros.dataset import open_dataset

    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    console, failures, scenes = make_console(soft_wrap=True, highlight=False), list[str](), 0
    pooled = open_pool(workers, ray, module=module, memory_mib=memory_mib, reads=[dataset], writes=[out])
    with pooled as pool:
        for seen, folder in exported_agents(opened, agent, out):
            with counting_bar(unit, make_console(stderr=True), elapsed=True) as bar:
                done = export(seen, folder, pool, bar.show)
            if done.scenes:
                report(done, folder, console)
            failures, scenes = [*failures, *done.failures.values()], scenes + len(seen.scenes)
    if len(failures) == scenes:
        raise InputError("\n".join(failures))
    for reason in failures:
        console.print(reason, style="red")
    if failures:
        raise SimbevError(f"{len(failures)} of {plural(scenes, 'scene')} could not be exported")


def show_earlier(done: Any, console: Console) -> None:
    """Print how many scenes of an export were there before."""
    if there := done.scenes - done.made:
        console.print(f"{plural(there, 'scene')} {'was' if there == 1 else 'were'} there already")
