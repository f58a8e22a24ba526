"""``simbev generate``: make a dataset, or what is missing of it."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from simbev_ros.config.load import load_scenario

if TYPE_CHECKING:
    from simbev_ros.production.dataset_maker import Outcome


def generate(
    config: Annotated[str, typer.Argument(help="Configuration file, or demo, live, paper, stack.", show_default=False)],
    out: Annotated[Path, typer.Option(help="The dataset's folder, new or begun.", show_default=False)],
    replace: Annotated[
        list[str] | None,
        typer.Option(help="Make these scenes anew, and no others: numbers and ranges.", metavar="3,17-20"),
    ] = None,
    retries: Annotated[int, typer.Option(help="How often to try a scene again that has failed.", min=0, max=10)] = 2,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Say what would be made, how long and how large.")] = False,
) -> None:
    """Make as many scenes of each map and split as the configuration asks for; those that are there count.

    After Ctrl-C, a crash or a power cut the same command goes on where it was. A scene that fails is tried again, then
    listed, and the others go on; the exit code is 1 then. The dataset has an index, index.parquet, and a log per scene.

    [bold]Examples[/]

    simbev generate paper --out datasets/simbev --dry-run

    simbev generate my.yaml --out datasets/first

    simbev generate my.yaml --out datasets/first --replace 3,17-20
    """
    from simbev_ros.dataset.lock import DatasetLock
    from simbev_ros.dataset.plan import Plan, PlannedEntry, numbers_of
    from simbev_ros.dataset.staging import clean_up
    from simbev_ros.production.dataset_maker import DatasetMaker
    from simbev_ros.recording.layout import scenes_folder

    scenario, console = load_scenario(config).model_copy(update={"evaluation": None}), Console()  # no stack runs here
    numbers = numbers_of(replace or ())

    def planned() -> tuple[Plan, list[PlannedEntry]]:
        plan = Plan.of(out).extended(scenario)
        return plan, plan.chosen(numbers) if numbers else plan.to_make(out, scenario)

    _, entries = planned()  # bad input is refused before anything is written
    if dry_run:
        from simbev_ros.production.estimate import show_estimate

        show_estimate(scenario, out, entries, console)
        return
    with DatasetLock(out):
        clean_up(out)
        plan, entries = planned()
        plan.save(out)
        scenes_folder(out).mkdir(exist_ok=True)  # a dataset from now on, to all who look
        with DatasetMaker(scenario, out, console, retries=retries) as maker:
            outcome = maker.make(entries)
    _show(outcome, out, console)
    raise typer.Exit(1 if outcome.failed else 0)


def _show(outcome: "Outcome", out: Path, console: Console) -> None:
    made, failed = len(outcome.made), outcome.failed
    console.print(f"{made} scene{'s' * (made != 1)} made in {out}", highlight=False, soft_wrap=True)
    if failed:
        table = Table("scene", "what is wrong", title=f"{len(failed)} failed")
        for name, problem in failed.items():
            table.add_row(escape(name), escape(problem))
        console.print(table)
