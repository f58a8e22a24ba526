"""Checked bird's-eye-view scores of a perception stack, and the files that hold them.

Arrays or NPZ files become one ``ScoreGrid`` per frame.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from simbev_ros.evaluation.predictions.npz_file import read_npz
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Int64Array

GRIDS_FOLDER = "grids"
_TICK = re.compile(r"\d{6,}")


@dataclass(frozen=True, slots=True, eq=False)
class ScoreGrid:
    """Checked scores of one frame.

    Attributes:
        classes: Predicted classes, out of ``BEV_CLASSES``.
        scores: (C, H, W), one layer per class: floating, 0 … 1, or uint8, where 255 is 1; row 0 ahead, column 0 left.
        source: File or topic, for error messages.
    """

    classes: tuple[str, ...]
    scores: AnyArray
    source: str

    def __post_init__(self) -> None:
        """Raise InputError for an invalid class, shape, type or score."""
        unknown = [name for name in self.classes if name not in BEV_CLASSES]
        if unknown:
            raise InputError(f"{self.source}: classes: there is no {unknown[0]!r}; allowed: {', '.join(BEV_CLASSES)}")
        if len(set(self.classes)) != len(self.classes):
            raise InputError(f"{self.source}: classes: {', '.join(self.classes)}: each is allowed once")
        scores, shape = self.scores, self.scores.shape
        if len(shape) != 3 or shape[0] != len(self.classes):
            allowed = f"({len(self.classes)}, rows, columns), one layer a class"
            raise InputError(f"{self.source}: scores: have the shape {shape}; it must be {allowed}")
        if scores.dtype != np.uint8 and scores.dtype.kind != "f":
            raise InputError(f"{self.source}: scores: are of the type {scores.dtype}; allowed: floating and uint8")
        # NaN fails both comparisons, and min and max of an array with NaN are NaN.
        if scores.dtype.kind == "f" and scores.size and not (scores.min() >= 0 and scores.max() <= 1):
            index = tuple(np.argwhere(~((scores >= 0) & (scores <= 1)))[0].tolist())
            value = f"{self.classes[index[0]]} at row {index[1]}, column {index[2]} is {scores[index]}"
            raise InputError(f"{self.source}: scores: {value}; allowed: 0 to 1")

    def require_shape(self, rows: int, columns: int) -> None:
        """Raise InputError if the grid differs in size from the ground truth."""
        if self.scores.shape[1:] != (rows, columns):
            size = " x ".join(str(count) for count in self.scores.shape[1:])
            raise InputError(f"{self.source}: scores: have {size} cells; the truth has {rows} x {columns}")


class GridFolder:
    """Folder of files ``<scene>/<tick:06d>.npz`` with ``scores`` and optionally ``classes``; read one by one.

    Attributes:
        scenes: Names of the scenes, sorted.
    """

    has_scene_names = True

    def __init__(self, path: Path) -> None:
        self.path = path
        self.scenes = tuple(sorted(each.name for each in path.iterdir() if each.is_dir()))

    def grid_ticks(self, scene: str, stamps_ns: Int64Array) -> frozenset[int]:
        """Ticks of a scene that have a file.

        Raises:
            InputError: The name of a file is not a tick of the scene.
        """
        return frozenset(_tick_of(file, len(stamps_ns)) for file in sorted((self.path / scene).glob("*.npz")))

    def grid(self, scene: str, tick: int, stamps_ns: Int64Array) -> ScoreGrid:
        """Scores of a tick that has a file.

        Raises:
            InputError: The file is damaged, or its content is not as ``ScoreGrid`` requires.
        """
        del stamps_ns  # files are named by ticks
        return read_grid(grid_file(self.path, scene, tick))


def grid_file(folder: Path, scene: str, tick: int) -> Path:
    """Path of the file with the grid of a frame."""
    return path_inside(folder, Path(scene, f"{tick:06d}.npz"))


def read_grid(path: Path) -> ScoreGrid:
    """Read the grid in one file.

    Raises:
        InputError: As ``GridFolder.grid``.
    """
    arrays = read_npz(path)
    if "scores" not in arrays:
        raise InputError(f"{path}: there is no array 'scores', but {', '.join(arrays) or 'nothing'}")
    classes: Sequence[str] = BEV_CLASSES
    if "classes" in arrays:
        classes = [str(name) for name in np.atleast_1d(arrays["classes"]).ravel()]
    return ScoreGrid(tuple(classes), arrays["scores"], str(path))


def _tick_of(file: Path, count: int) -> int:
    if not _TICK.fullmatch(file.stem) or int(file.stem) >= count:
        allowed = f"that of a frame of the scene, 000000.npz to {count - 1:06d}.npz"
        raise InputError(f"{file}: its name must be the tick: {allowed}")
    return int(file.stem)
