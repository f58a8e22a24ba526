"""Perception stacks that come with the package; ``evaluation.stack`` starts them by name.

This table is the only place of their names.
"""

from dataclasses import dataclass
from typing import Literal

TRACK_OPTION = "--track"
"""Option of a baseline in ``evaluation.stack``: it tracks its boxes."""
Sight = Literal["camera", "lidar"]
"""Kinds of sensors that a stack sees."""


@dataclass(frozen=True, slots=True)
class IncludedStack:
    """A perception stack that comes with the package.

    Attributes:
        name: Its name in ``evaluation.stack``.
        module: The module that runs it.
        participant: Its name on /sync/ready, and that of its node, if it is the first agent's.
        sees: The sensors that it needs.
        modality: The baseline, as ``module`` takes it; None: it is not a trained model.
        merges: Whether it merges the boxes of other agents' stacks into its own.
    """

    name: str
    module: str
    participant: str
    sees: tuple[Sight, ...]
    modality: str | None = None
    merges: bool = False

    def participant_of(self, agent: str) -> str:
        """Its name on /sync/ready as the stack of an agent other than the first one (empty: of the first)."""
        return f"{agent}_{self.participant}" if agent else self.participant

    @property
    def is_model(self) -> bool:
        """Whether it is a trained model: a file of weights and ``TRACK_OPTION`` may follow its name."""
        return self.modality is not None


_BASELINES: dict[str, tuple[Sight, ...]] = {
    "camera": ("camera",),
    "lidar": ("lidar",),
    "fused": ("camera", "lidar"),
}


def baseline_stack(modality: str) -> IncludedStack:
    """The stack of a trained baseline.

    Raises:
        KeyError: There is no such baseline.
    """
    sees = _BASELINES[modality]
    return IncludedStack(f"baseline-{modality}", "simbev_ros.baselines.node", f"baseline_{modality}", sees, modality)


INCLUDED_STACKS = {
    stack.name: stack
    for stack in (
        IncludedStack("reference", "simbev_ros.reference_stack", "reference_stack", ("lidar",)),
        IncludedStack(
            "cooperative", "simbev_ros.reference_stack.cooperative", "cooperative_stack", ("lidar",), merges=True
        ),
        *map(baseline_stack, _BASELINES),
    )
}
"""All included stacks by name."""

INCLUDED_DRIVERS: dict[str, str | None] = {
    "drive-truth": None,
    "drive-learned": "baseline-lidar",
    "drive-constant": None,
}
"""Drivers of ``drive.stack`` that come with the package, each with the included stack of which it needs the boxes."""
DRIVER_INTERFACE = "path"
"""``ego.driver`` of vehicles that they drive."""
