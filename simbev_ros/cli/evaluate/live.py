"""Options and tables of ``simbev run`` and ``simbev replay`` for the evaluation of a perception stack."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from rich.console import Console

from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.included_stacks import INCLUDED_STACKS
from simbev_ros.config.scenario import Scenario
from simbev_ros.errors import InputError
from simbev_ros.recording.whole_files import require_writable, write_errors

_PANEL = "Evaluation of a perception stack"

FiguresOption = Annotated[
    Path | None,
    typer.Option(
        "--evaluate",
        help="Compare the answers of a stack with the truth; file (.json) for all figures, or folder for those of each "
        "scene.",
        metavar="PATH",
        rich_help_panel=_PANEL,
    ),
]
StackOption = Annotated[
    str | None,
    typer.Option(
        help="Run this command with the graph and evaluate its answers. Included are "
        f"{', '.join(INCLUDED_STACKS)}; a file (.onnx) of weights may follow a baseline.",
        metavar="COMMAND",
        rich_help_panel=_PANEL,
    ),
]


def with_evaluation(scenario: Scenario, figures: Path | None, stack: str | None) -> Scenario:
    """The configuration with the values of the options.

    Raises:
        InputError: An option is wrong, the figures cannot be written there, or the included stack cannot run.
    """
    from simbev_ros.graph.evaluated_stack import require_stack

    if figures is not None:
        _require_writable(figures)
    given = {"figures": None if figures is None else str(figures), "stack": stack}
    changed = {name: value for name, value in given.items() if value is not None}
    if not changed:
        require_stack(scenario)
        return scenario
    section = {} if scenario.evaluation is None else scenario.evaluation.model_dump()
    try:
        evaluation = Evaluation.model_validate({**section, **changed})
    except ValidationError as error:
        words = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise InputError(f"--stack {stack!r}: {words}") from None
    changed_scenario = scenario.model_copy(update={"evaluation": evaluation})
    require_stack(changed_scenario)
    return changed_scenario


def print_live_tables(figures: Mapping[str, Any], console: Console) -> None:
    """Print ``evaluation.live.live_figures`` as tables."""
    from simbev_ros.cli.evaluate.tables import print_tables

    print_tables(figures, console)
    frames, latency_ms = figures["frames"], figures["latency_ms"]
    latency = ", ".join(f"{name} {value:.1f} ms" for name, value in latency_ms.items() if value is not None)
    counts = f"{frames['missed']} frames missed, {frames['late']} answers late, {frames['malformed']} unusable"
    words = [f"{counts}; latency: {latency or 'unknown'}"]
    for what in ("input", "truth"):
        if count := frames[f"without_{what}"]:
            words.append(f"{count} frames do not count, as their {what} was left out or lost")
    console.print("\n".join(words), highlight=False, soft_wrap=True)


def _require_writable(figures: Path) -> None:
    folder = figures.parent if figures.suffix == ".json" else figures
    require_writable(folder)
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    if figures.suffix == ".json" and figures.is_dir():
        raise InputError(f"--evaluate: {figures}: is a folder; one for figures must not end in .json")
    if not os.access(folder, os.W_OK):
        raise InputError(f"--evaluate: {folder}: cannot be written to")
