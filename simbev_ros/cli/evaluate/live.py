"""Options and tables of ``simbev run`` and ``simbev replay`` for the evaluation of a perception stack."""

import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError
from rich.console import Console

from simbev_ros.config.evaluation import Evaluation, answer_topics_of
from simbev_ros.config.included_stacks import INCLUDED_STACKS
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import is_stream, require_replaceable, require_writable, write_errors

_AGENT_NAME = re.compile("[a-z][a-z0-9_]*")
_PANEL = "Evaluation of a perception stack"

FiguresOption = Annotated[
    Path | None,
    typer.Option(
        "--evaluate",
        help="Compare the answers of a stack with the truth; file (.json) for all figures, or folder for those of each "
        "scene. Figures of other agents than the first one are in FILE_AGENT.json, or FOLDER/AGENT.",
        metavar="PATH",
        rich_help_panel=_PANEL,
    ),
]
StackOption = Annotated[
    list[str] | None,
    typer.Option(
        help="Run this command with the graph and evaluate its answers. Included are "
        f"{', '.join(INCLUDED_STACKS)}; a file (.onnx) of weights and --track, which gives boxes ids, may follow "
        "a baseline. In a scene with several agents, AGENT=COMMAND is the stack of one of them, and the option can be "
        "repeated.",
        metavar="COMMAND",
        rich_help_panel=_PANEL,
    ),
]


def with_evaluation(scenario: Scenario, figures: Path | None, stacks: Sequence[str]) -> Scenario:
    """The configuration with the values of the options.

    Args:
        scenario: The configuration.
        figures: File or folder for the figures of all evaluated stacks, or else of the first agent's one. Those of
            other agents are in a file or folder with the agent's name.
        stacks: Commands, after the name of an agent and ``=`` if they are not the first agent's.

    Raises:
        InputError: An option is wrong, the figures cannot be written there, or the included stack cannot run.
    """
    from simbev_ros.ros.graph.evaluated_stack import require_stacks

    commands = _commands(scenario, stacks)
    for agent, (option, command) in commands.items():
        scenario = _with_section(scenario, agent, f"--stack {option!r}", stack=command)
    if figures is not None:
        for agent in [each.name for each in scenario.evaluated_agents] or [""]:
            path = _figures_of(figures, agent)
            _require_writable(path)
            scenario = _with_section(scenario, agent, f"--evaluate {path}", figures=str(path))
    require_stacks(scenario)
    return scenario


def _commands(scenario: Scenario, stacks: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Option and command by the name of the agent; that of the first agent is empty.

    Raises:
        InputError: There is no such agent, not every scene has it, or it is given two stacks.
    """
    names = {scenario.rig.agent: "", **{agent.name: agent.name for agent in scenario.agents if agent.count is None}}
    commands = dict[str, tuple[str, str]]()
    for option in stacks:
        name, sign, command = option.partition("=")
        if not (sign and _AGENT_NAME.fullmatch(name)):
            name, command = scenario.rig.agent, option
        if name not in names:
            raise InputError(f"--stack {option!r}: every scene has these agents, but no {name!r}: {', '.join(names)}")
        if names[name] in commands:
            raise InputError(f"--stack {option!r}: {name} has a stack already; give each agent one")
        commands[names[name]] = option, command
    return commands


def _with_section(scenario: Scenario, agent: str, option: str, **changes: str) -> Scenario:
    """The configuration with changes to the section of an agent (empty: the first one), which an option asks for."""
    found = next((each.evaluation for each in scenario.evaluated_agents if each.name == agent), None)
    boxes_topic, grids_topic = answer_topics_of(agent)
    section = {"boxes_topic": boxes_topic, "grids_topic": grids_topic} if found is None else found.model_dump()
    try:
        evaluation = Evaluation.model_validate({**section, **changes})
    except ValidationError as error:
        words = error.errors()[0]["msg"].removeprefix("Value error, ")
        raise InputError(f"{option}: {words}") from None
    if not agent:
        return scenario.model_copy(update={"evaluation": evaluation})
    agents = tuple(
        each.model_copy(update={"evaluation": evaluation}) if each.name == agent else each for each in scenario.agents
    )
    return scenario.model_copy(update={"agents": agents})


def _figures_of(figures: Path, agent: str) -> Path:
    """File or folder for the figures of an agent's stack (empty: the first agent's)."""
    if not agent:
        return figures
    return figures.with_stem(f"{figures.stem}_{agent}") if figures.suffix == ".json" else figures / agent


def print_live_tables(figures: Mapping[str, Any], console: Console) -> None:
    """Print ``evaluation.live.live_figures`` as tables."""
    from simbev_ros.cli.evaluate.tables import print_figure_tables, print_tables

    if "agent" in figures:
        console.print(f"stack of {figures['agent']}", style="bold", highlight=False, soft_wrap=True)
    print_tables(figures, console)
    frames, latency_ms = figures["frames"], figures["latency_ms"]
    latency = ", ".join(f"{name} {value:.1f} ms" for name, value in latency_ms.items() if value is not None)
    counts = f"{frames['missed']} frames missed, {frames['late']} answers late, {frames['malformed']} unusable"
    words = [f"{counts}; latency: {latency or 'unknown'}"]
    for what in ("input", "truth"):
        if count := frames[f"without_{what}"]:
            words.append(f"{count} frames do not count, as their {what} was left out or lost")
    console.print("\n".join(words), highlight=False, soft_wrap=True)
    if drives := figures.get("drives"):
        from simbev_ros.evaluation.driving.tables import score_table

        print_figure_tables([score_table(drives["scenes"], drives)], console)


def _require_writable(figures: Path) -> None:
    folder = figures.parent if figures.suffix == ".json" else figures
    require_writable(folder)
    with write_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    if figures.suffix == ".json" and figures.is_dir():
        raise InputError(f"--evaluate: {figures}: is a folder; one for figures must not end in .json")
    if figures.suffix == ".json" and not is_stream(figures):
        require_replaceable(figures)
    if not os.access(folder, os.W_OK):
        raise InputError(f"--evaluate: {folder}: cannot be written to")
