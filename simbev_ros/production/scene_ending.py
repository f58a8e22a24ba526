"""How an attempt at a scene has ended."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from simbev_ros.dataset.index_row import Row
from simbev_ros.foundation.errors import SimbevError
from simbev_ros.production.scene_cost import SceneCost

Output = Mapping[str, str]
"""Output of a graph's processes while they played a scene, by label of the process."""


@dataclass(frozen=True, slots=True)
class MadeScene:
    """A scene with a finished bag.

    Attributes:
        row: The scene's row of the dataset's index.
        summary: One line on how it ended.
        output: Output of the graph.
        cost: What it took.
    """

    row: Row
    summary: str
    output: Output
    cost: SceneCost


@dataclass(frozen=True, slots=True)
class FailedScene:
    """An attempt at a scene that has left no bag, with its reason and the output of the graph."""

    error: SimbevError
    output: Output = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class LostScene:
    """A scene with a worker that died or fell silent before the end; that says nothing about the scene."""

    reason: str


SceneEnding = MadeScene | FailedScene | LostScene
