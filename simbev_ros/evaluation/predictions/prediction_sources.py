"""What predictions can come from: files and bags, each with what it says of some scenes."""

from pathlib import Path
from typing import Protocol

from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.types import Int64Array


class Source(Protocol):
    """Something on a disk that can be sent to other processes.

    Attributes:
        path: Where it is.
        scenes: Names of those that it says something of.
        is_named: False: nothing in it says of which scene it is, and ``scenes`` is its stem.
    """

    path: Path
    scenes: tuple[str, ...]
    is_named: bool


class BoxSource(Source, Protocol):
    """What predicts boxes."""

    def boxes(self, scene: str, stamps_ns: Int64Array) -> tuple[PredictedBoxes, frozenset[int]]:
        """Boxes of a scene, whose (T,) frames have these stamps, and the ticks that were answered.

        Raises:
            InputError: It is damaged, or a value is none that it can have.
        """


class GridSource(Source, Protocol):
    """What predicts bird's-eye-view scores."""

    def grid_ticks(self, scene: str, stamps_ns: Int64Array) -> frozenset[int]:
        """Ticks of a scene, whose (T,) frames have these stamps, that have scores of at least one class.

        Raises:
            InputError: Something is said of what is no frame, or twice of one.
        """

    def grid(self, scene: str, tick: int, stamps_ns: Int64Array) -> ScoreGrid:
        """Scores of a tick that has some.

        Raises:
            InputError: They are damaged, or not as ``ScoreGrid`` says.
        """
