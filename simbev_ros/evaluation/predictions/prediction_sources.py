"""Interfaces of the sources of predictions: files and bags with answers for some scenes.

``dataset_predictions`` reads every source through these protocols.
"""

from pathlib import Path
from typing import Protocol

from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes
from simbev_ros.evaluation.predictions.score_grid import ScoreGrid
from simbev_ros.foundation.types import Int64Array


class PredictionSource(Protocol):
    """Source on disk that can be sent to other processes.

    Attributes:
        path: File or folder of the source.
        scenes: Names of the scenes for which it has predictions.
        has_scene_names: Whether its content names the scenes; otherwise ``scenes`` is its stem.
    """

    path: Path
    scenes: tuple[str, ...]
    has_scene_names: bool


class BoxSource(PredictionSource, Protocol):
    """Source of predicted boxes."""

    def boxes(self, scene: str, stamps_ns: Int64Array) -> tuple[PredictedBoxes, frozenset[int]]:
        """Boxes of a scene with frames at (T,) stamps, and the ticks that were answered.

        Raises:
            InputError: The source is damaged, or a value is invalid.
        """


class GridSource(PredictionSource, Protocol):
    """Source of bird's-eye-view scores."""

    def grid_ticks(self, scene: str, stamps_ns: Int64Array) -> frozenset[int]:
        """Ticks with scores of at least one class, of a scene with frames at (T,) stamps.

        Raises:
            InputError: There is an answer to a frame that does not exist, or there are two to the same frame.
        """

    def grid(self, scene: str, tick: int, stamps_ns: Int64Array) -> ScoreGrid:
        """Scores of a tick that has some.

        Raises:
            InputError: The scores are damaged, or not as ``ScoreGrid`` requires.
        """
