"""``simbev generate``: makes a dataset, or its missing scenes."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.console import Console
from rich.table import Table

from simbev_ros.cli.console import make_console
from simbev_ros.cli.pool import MAX_GRAPHS, worker_count
from simbev_ros.cli.scene_numbers import scene_numbers
from simbev_ros.cli.scene_options import Config, GraphRay, GraphWorkers
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url

if TYPE_CHECKING:
    from simbev_ros.config.scenario import Scenario
    from simbev_ros.production.dataset import DatasetResult


def generate(
    config: Config,
    out: Annotated[
        str, typer.Option(help="The dataset, new or begun: a folder, or s3://bucket/prefix.", show_default=False)
    ],
    replace: Annotated[
        list[str] | None, typer.Option(help="Make only these scenes again: numbers and ranges.", metavar="3,17-20")
    ] = None,
    retries: Annotated[int, typer.Option(help="Maximum number of retries of a failed scene.", min=0, max=10)] = 2,
    workers: GraphWorkers = None,
    ray: GraphRay = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Only estimate the number, time and size of scenes.")
    ] = False,
) -> None:
    """Make the scenes of each map and split that the configuration asks for; existing scenes are kept.

    After Ctrl-C, a crash or a power cut the same command continues where it stopped. A scene that fails is retried,
    then listed, and the others follow; the exit code is 1 then. The dataset gets an index, index.parquet, and a log for
    each scene.

    [bold]Examples[/]

    simbev generate paper --out datasets/simbev --dry-run

    simbev generate my.yaml --out datasets/first

    simbev generate my.yaml --out datasets/first --workers auto

    simbev generate my.yaml --out /shared/datasets/first --ray auto

    simbev generate my.yaml --out datasets/first --replace 3,17-20

    simbev generate my.yaml --out s3://bucket/datasets/first
    """
    from simbev_ros.cli.production_display import DatasetDisplay
    from simbev_ros.production.dataset import changed_sections, check_workers, make_dataset

    if isinstance(path_or_url(config), ObjectPath):
        raise InputError(f"{config}: a configuration is a local file; only --out takes a URL")
    scenario, numbers, console = load_scenario(config), scene_numbers("--replace", replace or ()), make_console()
    count, dataset = worker_count(workers, MAX_GRAPHS), path_or_url(out)
    check_workers(count, ray)
    if dry_run:
        _estimate(scenario, dataset, numbers, console, count, ray)
        return
    if changed := [] if numbers else changed_sections(scenario, dataset):
        words = f"warning: {dataset} has scenes of another configuration ({', '.join(changed)} differ); they are kept"
        console.print(f"{words}, --replace makes them again", highlight=False, soft_wrap=True)
    display = DatasetDisplay(console)
    result = make_dataset(scenario, dataset, replace=numbers, retries=retries, workers=count, ray=ray, observer=display)
    _show(result, console)
    raise typer.Exit(0 if result.is_complete else 1)


def _estimate(
    scenario: "Scenario",
    out: AnyPath,
    numbers: list[range],
    console: Console,
    workers: int | Literal["auto"] | None,
    ray: str | None,
) -> None:
    """Print what the scenes would cost, on this machine or on a cluster."""
    from simbev_ros.cli.estimate_table import show_estimate
    from simbev_ros.foundation.threads import usable_cores
    from simbev_ros.production.cluster.ray_cluster import RayCluster
    from simbev_ros.production.workers.machine_capacity import expected_speedup

    if ray is None:
        show_estimate(scenario, out, numbers, console, lambda cost: expected_speedup(workers, cost, usable_cores()))
        return
    with RayCluster(ray) as cluster:
        show_estimate(scenario, out, numbers, console, lambda cost: cluster.expected_speedup(cost.cores))


def _show(result: "DatasetResult", console: Console) -> None:
    """Print how many scenes were made, and a table of those that failed or are damaged."""
    made = plural(len(result.made), "scene")
    rest = "" if result.made or result.failed else f"; {plural(len(result.skipped), 'scene')} there already"
    console.print(f"{made} made in {result.path}{rest}", highlight=False, soft_wrap=True)
    remedies = {
        name: f"damaged: {problem}; --replace {int(name.rpartition('-')[2])} makes it again"
        for name, problem in result.damaged.items()
    }
    show_failures({**result.failed, **remedies}, console)


def show_failures(failed: Mapping[str, str], console: Console) -> None:
    """Print a table of the scenes that failed, each with what is wrong, if there are any."""
    if failed:
        table = Table("scene", "what is wrong", title=f"{len(failed)} failed")
        for name, problem in failed.items():
            table.add_row(name, problem)
        console.print(table)
