"""The option ``--agent`` of the verbs that read what one agent of a scene has recorded."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from simbev_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from simbev_ros.dataset import Dataset

ALL = "all"
"""Value that stands for all agents, where a verb allows it."""

AgentOption = Annotated[
    str | None, typer.Option(help="Agent of the scene; by default the first one.", metavar="NAME", show_default=False)
]

ShownAgentOption = Annotated[
    str | None,
    typer.Option(
        help="Agent of the scene; by default the first one; all: a plan with the points and boxes of all agents.",
        metavar="NAME|all",
        show_default=False,
    ),
]

ExportedAgentOption = Annotated[
    str | None,
    typer.Option(
        help="Agent to export; by default the first one; all: each agent, to a folder of its name.",
        metavar="NAME|all",
        show_default=False,
    ),
]


def require_agent(agent: str, names: Sequence[str], source: object) -> None:
    """Require that an agent that was asked for exists.

    Args:
        agent: Name of the agent.
        names: Names of the agents that there are; empty: they are not known, as the bag holds no scene.
        source: The bag or the scene, for the message.

    Raises:
        InputError: There is no such agent.
    """
    if agent not in names:
        known = ", ".join(names) or "no scene, so its agents are not known"
        raise InputError(f"--agent {agent!r:.80}: {source} has {known}")


def of_agent(dataset: "Dataset", agent: str | None) -> "Dataset":
    """The scenes of a dataset that have an agent, as it sees them; None: all scenes, as the first agent sees each.

    Raises:
        InputError: No scene has the agent.
        BagError: A scene cannot be read.
    """
    if agent is None:
        return dataset
    require_agent(agent, dataset.agents, dataset.path)
    return dataset.of_agent(agent)


def exported_agents(dataset: "Dataset", agent: str | None, out: Path) -> list[tuple["Dataset", Path]]:
    """The datasets to export, each with its folder.

    Args:
        dataset: The dataset.
        agent: Value of ``ExportedAgentOption``.
        out: Folder of the export; that of all agents has a folder for each. A dataset without scenes has one folder.

    Raises:
        InputError: No scene has the agent.
        BagError: A scene cannot be read.
    """
    if not dataset.scenes:
        return [(dataset, out)]
    if agent != ALL:
        return [(of_agent(dataset, agent), out)]
    return [(dataset.of_agent(name), out / name) for name in dataset.agents]
