"""The option ``--agent`` of the verbs that show what one agent of a scene has recorded."""

from collections.abc import Sequence
from typing import Annotated

import typer

from simbev_ros.errors import InputError

AgentOption = Annotated[
    str | None, typer.Option(help="Agent of the scene; by default the first one.", metavar="NAME", show_default=False)
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
