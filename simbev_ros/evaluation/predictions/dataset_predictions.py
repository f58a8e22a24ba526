"""Predictions for the scenes of a dataset, from files or bags: boxes and bird's-eye-view scores.

``open_predictions`` opens them for offline evaluation. It returns a ``PredictionSet``, from which each scene reads its
boxes and grids. The formats are:

**Boxes in files** are Parquet or NPZ, with one row per box and these columns:

| column | |
|---|---|
| scene | name of the scene; optional: without it, it is the file's stem, or the dataset's only scene |
| tick or stamp_ns | integers: index of the frame in the scene, from 0, or its exact stamp |
| class | name or number of ``foundation.semantics.BOX_CLASSES`` |
| score | confidence, higher is more confident; finite |
| x y z length width height yaw | center and size, m, and heading about z, rad |
| vx vy vz | optional: velocity over ground, m/s; missing, null or NaN: unknown; if only vz is: 0 |
| id | optional integer: track of the box in its scene; null or negative: none |

``frame_id``, in the metadata of the Parquet schema or as a text in the NPZ, is the coordinate frame of the boxes, any
of /tf: ``map`` (the default), ``ego/base_link``, ``ego/lidar`` …. Velocities are given along its axes, but are over
ground. Boxes are upright in it. A frame without rows is not answered, which counts like an answer without boxes, but is
reported. A row whose class and score are both empty (null, "" or NaN; -1 for class numbers) answers a frame without
boxes.

**Scores** of frames are in ``grids/<scene>/<tick:06d>.npz``: ``scores`` (C, H, W), row 0 ahead, column 0 left, uint8
(255 is 1) or floating (0 … 1); ``classes`` (C,) names, unless they are all of ``semantics.BEV_CLASSES`` in order.

**A folder** stands for everything in it: ``*.parquet``, ``*.npz``, ``grids``, bags. A dataset stands for its scenes'
bags.

**A bag** (MCAP) has boxes on /prediction/boxes and scores on /prediction/bev, as ``prediction_messages`` describes.
The stamp of a message is that of the frame it answers. The scene is named by /world/scene in the bag; otherwise it is
the bag's stem, or the dataset's only scene. With several scenes, each has its own range of stamps. Answers to frames
before tick 0 are ignored.

To write a file of boxes without this package::

    import pyarrow as pa, pyarrow.parquet as pq
    rows = []
    for scene, tick, points in frames:
        for box in detector(points):
            rows.append({"scene": scene, "tick": tick, "class": box.name, "score": box.score,
                         "x": box.x, "y": box.y, "z": box.z, "length": box.length, "width": box.width,
                         "height": box.height, "yaw": box.yaw, "vx": box.vx, "vy": box.vy})
    table = pa.Table.from_pylist(rows).replace_schema_metadata({"frame_id": "ego/lidar"})
    pq.write_table(table.sort_by([("scene", "ascending"), ("tick", "ascending")]), "predictions.parquet")

With this package, use ``write_predictions`` and ``write_grid``.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TypeVar

from simbev_ros.config.evaluation import BOXES_TOPIC, GRIDS_TOPIC
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes, boxes_in_map, join_boxes
from simbev_ros.evaluation.predictions.prediction_bag import PredictionBag
from simbev_ros.evaluation.predictions.prediction_files import NpzBoxes, ParquetBoxes
from simbev_ros.evaluation.predictions.prediction_sources import BoxSource, GridSource, PredictionSource
from simbev_ros.evaluation.predictions.prediction_writer import write_grid, write_predictions
from simbev_ros.evaluation.predictions.score_grid import GRIDS_FOLDER, GridFolder, ScoreGrid
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.files.input_file import path_exists
from simbev_ros.foundation.types import Int64Array
from simbev_ros.recording.layout import PARTIAL_SUFFIX, REPLACED_SUFFIX, is_dataset, numbered_files, scenes_of
from simbev_ros.recording.mcap.chunk_cache import ChunkCache

__all__ = ["PredictedScene", "PredictionSet", "boxes_in_map", "open_predictions", "write_grid", "write_predictions"]

_CACHE_BYTES = 64 << 20
_AnySource = TypeVar("_AnySource", BoxSource, GridSource)


@dataclass(frozen=True, eq=False)
class PredictedScene:
    """Predictions for one scene; reading them raises InputError where a value is invalid.

    Attributes:
        name: Name of the scene.
        stamps_ns: (T,) stamps of its frames.
        box_sources: Sources of boxes, each with the scene's name there.
        grid_sources: Sources of grids, each with the scene's name there.
    """

    name: str
    stamps_ns: Int64Array
    box_sources: tuple[tuple[BoxSource, str], ...]
    grid_sources: tuple[tuple[GridSource, str], ...]

    def boxes(self) -> PredictedBoxes:
        """All boxes of the scene."""
        return join_boxes([boxes for boxes, _ in self._box_answers])

    def grid(self, tick: int) -> ScoreGrid | None:
        """Scores of a frame; None if there are none."""
        source = self._grids.get(tick)
        return None if source is None else source[0].grid(source[1], tick, self.stamps_ns)

    @cached_property
    def ticks_with_grid(self) -> frozenset[int]:
        """Ticks that have scores."""
        return frozenset(self._grids)

    @cached_property
    def ticks_with_boxes(self) -> frozenset[int]:
        """Ticks with an answer about boxes, possibly that there are none."""
        return frozenset(tick for _, ticks in self._box_answers for tick in ticks)

    @cached_property
    def _box_answers(self) -> list[tuple[PredictedBoxes, frozenset[int]]]:
        answers = [source.boxes(name, self.stamps_ns) for source, name in self.box_sources]
        answered: dict[int, Path] = {}
        for (source, _), (_, ticks) in zip(self.box_sources, answers, strict=True):
            if isinstance(source, PredictionBag):
                for tick in sorted(ticks):
                    if answered.setdefault(tick, source.path) != source.path:
                        raise InputError(
                            f"{source.path}: boxes of tick {tick} of {self.name} are also in {answered[tick]}"
                        )
        return answers

    @cached_property
    def _grids(self) -> dict[int, tuple[GridSource, str]]:
        found: dict[int, tuple[GridSource, str]] = {}
        for source, name in self.grid_sources:
            for tick in sorted(source.grid_ticks(name, self.stamps_ns)):
                if tick in found:
                    raise InputError(
                        f"{source.path}: scores of tick {tick} of {self.name} are also in {found[tick][0].path}"
                    )
                found[tick] = source, name
        return found


class PredictionSet:
    """Predictions for several scenes; can be sent to other processes.

    Attributes:
        path: File or folder of the predictions.
        scenes: Names of the scenes, without duplicates; the stem for a source that names no scene.
    """

    def __init__(
        self,
        path: Path,
        box_sources: Sequence[BoxSource],
        grid_sources: Sequence[GridSource],
        names: Mapping[str, str] | None = None,
    ) -> None:
        """Take the sources, and the scene name for each source that names none, by its stem."""
        self.path, self._box_sources, self._grid_sources = path, tuple(box_sources), tuple(grid_sources)
        self._boxes = _by_scene(self._box_sources, names or {})
        self._grids = _by_scene(self._grid_sources, names or {})
        self.scenes = tuple(dict.fromkeys([*self._boxes, *self._grids]))

    @property
    def has_grids(self) -> bool:
        """Whether there may be scores."""
        return bool(self._grid_sources)

    def for_dataset(self, scenes: Sequence[str]) -> "PredictionSet":
        """The same predictions with ``scenes`` limited to those of a dataset.

        A source that names no scene, and has no scene's name as its stem, belongs to the only scene of the dataset, if
        it has just one.

        Args:
            scenes: Names of the scenes of the dataset.

        Raises:
            InputError: There are predictions for a scene that the dataset does not have.
        """
        known, names = set(scenes), dict[str, str]()
        sources: list[PredictionSource] = [*self._box_sources, *self._grid_sources]
        for source in sources:
            for source_scene in source.scenes:
                if source_scene not in known and not source.has_scene_names and len(known) == 1:
                    names[source_scene] = scenes[0]
                elif source_scene not in known:
                    examples = ", ".join(sorted(known)[:5]) + (", …" if len(known) > 5 else "")
                    hint = (
                        ""
                        if source.has_scene_names
                        else ", taken from the file's name because nothing in it names a scene"
                    )
                    text = f"scene: there is no {source_scene!r}{hint}; the dataset has {examples or 'no scene'}"
                    raise InputError(f"{source.path}: {text}")
        return PredictionSet(self.path, self._box_sources, self._grid_sources, names)

    def scene(self, name: str, stamps_ns: Int64Array) -> PredictedScene:
        """Predictions for a scene, possibly none.

        Args:
            name: Name of the scene.
            stamps_ns: (T,) stamps of its frames, ascending.
        """
        return PredictedScene(name, stamps_ns, tuple(self._boxes.get(name, ())), tuple(self._grids.get(name, ())))


def _by_scene(sources: Sequence[_AnySource], names: Mapping[str, str]) -> dict[str, list[tuple[_AnySource, str]]]:
    """Sources of each scene, with the scene's name there."""
    found: dict[str, list[tuple[_AnySource, str]]] = {}
    for source in sources:
        for source_scene in source.scenes:
            name = source_scene if source.has_scene_names else names.get(source_scene, source_scene)
            found.setdefault(name, []).append((source, source_scene))
    return found


def open_predictions(path: Path | str, boxes_topic: str = BOXES_TOPIC, grids_topic: str = GRIDS_TOPIC) -> PredictionSet:
    """Open files, bags, or a folder of them; the docstring of this module describes the formats.

    Args:
        path: A Parquet, NPZ or MCAP file, a bag, a folder, or a dataset with predictions in its bags.
        boxes_topic: Topic of boxes in bags.
        grids_topic: Topic of scores in bags; OccupancyGrids have one topic per class below it.

    Raises:
        InputError: There is nothing, or it cannot be read, lacks a column, or has a column of a wrong type.
    """
    path = Path(path)
    if not path_exists(path):
        raise InputError(f"{path}: no such file or folder")
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    boxes: list[BoxSource] = [
        _BOX_FILES[file.suffix](file) for file in files if file.suffix in _BOX_FILES and file.is_file()
    ]
    grids: list[GridSource] = [GridFolder(file) for file in files if file.name == GRIDS_FOLDER and file.is_dir()]
    cache = ChunkCache(_CACHE_BYTES)
    bags = [PredictionBag(bag, cache, boxes_topic, grids_topic) for bag in _bag_paths(path)]
    answering = [bag for bag in bags if bag.has_answers]
    if bags and not answering:
        known = bags[0].topics
        has = ", ".join(known[:_MAX_TOPICS_NAMED]) + (", …" if len(known) > _MAX_TOPICS_NAMED else "") or "none"
        raise BagError(
            f"{bags[0].path}: there is no topic {boxes_topic}, {grids_topic} or {grids_topic}/<class>; it has {has}"
        )
    if not (boxes or grids or bags):
        raise InputError(
            f"{path}: holds no predictions; allowed are *.parquet, *.npz, {GRIDS_FOLDER}/ and bags (*.mcap)"
        )
    return PredictionSet(path, [*boxes, *answering], [*grids, *answering])


_MAX_TOPICS_NAMED = 12
"""Maximum number of topics that an error message lists."""
_BOX_FILES: dict[str, Callable[[Path], BoxSource]] = {".parquet": ParquetBoxes, ".npz": NpzBoxes}


def _bag_paths(path: Path) -> list[Path]:
    """Bags at a path: the path itself, those in the folder, or those of the dataset."""
    if path.is_file():
        return [path] if path.suffix == ".mcap" else []
    if is_dataset(path):
        return [bag for bag in scenes_of(path) if bag.suffix not in (PARTIAL_SUFFIX, REPLACED_SUFFIX)]
    files = sorted(path.glob("*.mcap"))
    folders = sorted({file.parent for file in path.glob("*/*.mcap")})
    try:
        return [*([path] if files and numbered_files(path) else []), *folders]
    except BagError:  # the files are not the parts of one bag, so each is a bag
        return [*files, *folders]
