"""Reads predicted boxes from Parquet and NPZ files, scene by scene.

For a requested scene, both kinds of file give the boxes and the answered ticks. ``dataset_predictions`` describes the
columns.
"""

from collections import OrderedDict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from simbev_ros.evaluation.metrics.boxes import NO_TRACK
from simbev_ros.evaluation.predictions.npz_file import read_npz
from simbev_ros.evaluation.predictions.predicted_boxes import (
    MAP_FRAME,
    TRACK_COLUMN,
    PredictedBoxes,
    Rows,
    named_labels,
    numbered_labels,
)
from simbev_ros.evaluation.predictions.prediction_columns import (
    ALL_COLUMNS,
    FRAME_COLUMNS,
    INTEGER_COLUMNS,
    TEXT_COLUMNS,
    SceneRows,
    parse_answers,
    require_columns,
    runs,
)
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError
from simbev_ros.foundation.files.limits import require_unpacked_size
from simbev_ros.foundation.types import AnyArray, Int64Array, UInt8Array

_MAX_CACHED_BYTES = 1 << 30
"""Size limit of one file's cached row groups; the last one read is always kept."""

_NUMBER_BYTES = 8
"""Size of a value in a column of numbers; texts are kept as numbers of a dictionary."""


class ParquetBoxes:
    """Reader of a Parquet file of boxes; for each scene, only the row groups that hold it are read.

    As many row groups are cached as one scene may need. A file in the order of its scenes is therefore read once and in
    little memory, whatever the order within scenes.

    Raises:
        InputError: The file cannot be read, lacks a column, has a column of a wrong type, or exceeds
            ``limits.max_unpacked_bytes`` in a row group or a scene.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        with _damage_as_input_error(path):
            schema = pq.read_schema(path)
            self._texts = [name for name in TEXT_COLUMNS if name in schema.names and _is_text(schema.field(name).type)]
            _require_types(path, schema)
            self._columns = [name for name in ALL_COLUMNS if name in schema.names and name != "scene"]
            self.frame_id = (schema.metadata or {}).get(b"frame_id", MAP_FRAME.encode()).decode()
            self.has_scene_names = "scene" in schema.names
            self._read_starts()
            self._rows = self._scene_rows()
        self.scenes = self._rows.scenes
        self._max_row_groups = self._rows.max_parts_per_scene(self._starts)
        self._kept: OrderedDict[int, pa.Table] = OrderedDict()
        self._kept_bytes = 0

    def boxes(self, scene: str, stamps_ns: Int64Array) -> tuple[PredictedBoxes, frozenset[int]]:
        """Boxes of a scene, and the ticks that were answered; see ``prediction_sources.BoxSource``."""
        number = self._rows.rows(scene)
        self._require_size(len(number), f"scene {scene}")
        group = np.searchsorted(self._starts, number, side="right") - 1
        with _damage_as_input_error(self.path):
            file = self._file()
            parts = [self._part(file, int(group[a]), number[a:b]) for a, b in zip(*runs(group), strict=True)]
            table = pa.concat_tables(parts) if parts else file.schema_arrow.empty_table().select(self._columns)
            rows = Rows(str(self.path), number)
            label = _parquet_labels(_typed("class", table), rows)
            columns = {name: _typed(name, table) for name in self._columns if name != "class"}
            for name in FRAME_COLUMNS:
                if name in columns and columns[name].null_count:
                    missing = columns[name].is_null().to_numpy()
                    rows.require(name, ~missing, np.full(len(missing), None), "a number")
            if TRACK_COLUMN in columns:
                columns[TRACK_COLUMN] = columns[TRACK_COLUMN].cast(pa.int64()).fill_null(NO_TRACK)
            arrays = {name: column.to_numpy() for name, column in columns.items()}
        return parse_answers(arrays, label, rows, self.frame_id, scene, stamps_ns)

    def _part(self, file: pq.ParquetFile, group: int, number: Int64Array) -> pa.Table:
        """Rows of one row group, by their numbers in the file."""
        if group in self._kept:
            self._kept.move_to_end(group)
        else:
            while self._kept and (len(self._kept) >= self._max_row_groups or self._kept_bytes > _MAX_CACHED_BYTES):
                self._kept_bytes -= self._kept.popitem(last=False)[1].nbytes
            self._kept[group] = file.read_row_group(group, columns=self._columns)
            self._kept_bytes += self._kept[group].nbytes
        table, first, count = self._kept[group], int(number[0] - self._starts[group]), len(number)
        if number[-1] - number[0] == count - 1:
            return table.slice(first, count)
        return table.take(pa.array(number - self._starts[group]))

    def _file(self) -> pq.ParquetFile:
        return pq.ParquetFile(self.path, read_dictionary=self._texts)

    def _read_starts(self) -> None:
        """Read the (G + 1,) first row of each row group; the last entry is the number of rows."""
        metadata = self._file().metadata
        groups = [metadata.row_group(group) for group in range(metadata.num_row_groups)]
        counts = [group.num_rows for group in groups]
        for number, group in enumerate(groups):
            self._require_size(group.num_rows, f"row group {number}")
            require_unpacked_size(group.total_byte_size, f"{self.path}: row group {number}")
        if not self.has_scene_names:
            self._require_size(sum(counts), "its only scene")
        self._starts: Int64Array = np.cumsum([0, *counts]).astype(np.int64)

    def _require_size(self, rows: int, subject: str) -> None:
        """Raise InputError if a number of rows takes too much memory."""
        require_unpacked_size(rows * len(self._columns) * _NUMBER_BYTES, f"{self.path}: {subject} of {rows:,} rows")

    def _scene_rows(self) -> SceneRows:
        """Index of scenes, from the scene column alone, row group by row group."""
        if not self.has_scene_names:
            return SceneRows.from_codes([self.path.stem], np.zeros(int(self._starts[-1]), np.uint8))
        file, numbers = self._file(), dict[str, int]()
        parts: list[tuple[Int64Array, ...]] = [(np.zeros(0, np.int64),) * 3]
        for group, first in enumerate(self._starts[:-1].tolist()):
            names, code = _encode_categories(_typed("scene", file.read_row_group(group, columns=["scene"])))
            start, stop = runs(code)
            rows = Rows(str(self.path), first + start)
            rows.require("scene", code[start] < len(names) - 1, np.full(len(start), None), "the name of a scene")
            known = np.array([numbers.setdefault(str(name), len(numbers)) for name in names[:-1]], np.int64)
            parts.append((known[code[start]], first + start, first + stop))
        return SceneRows([*numbers], *(np.concatenate(each) for each in zip(*parts, strict=True)))

    def __getstate__(self) -> dict[str, Any]:
        return {**self.__dict__, "_kept": OrderedDict(), "_kept_bytes": 0}


class NpzBoxes:
    """Reader of an NPZ file of boxes, which is read and kept as a whole; Parquet is better for many boxes.

    Raises:
        InputError: The file cannot be read, lacks a column, or has one of a wrong type or length.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        read = read_npz(path, (*ALL_COLUMNS, "frame_id"))
        arrays = {name: _decode_text(path, name, values) for name, values in read.items()}
        frame_id = arrays.pop("frame_id", np.array(MAP_FRAME))
        self.frame_id = _require_one_text(frame_id, path)
        require_columns(str(path), arrays)
        for name, values in arrays.items():
            _require_kind(path, name, str(values.dtype), _KINDS.get(values.dtype.kind, "") if values.ndim == 1 else "")
        for name, values in arrays.items():
            if len(values) != len(arrays["class"]):
                raise InputError(f"{path}: {name}: has {len(values)} rows; class has {len(arrays['class'])}")
        self.has_scene_names = "scene" in arrays
        self._rows = _npz_rows(path, arrays)
        self.scenes = self._rows.scenes
        self._arrays: dict[str, AnyArray] = arrays

    def boxes(self, scene: str, stamps_ns: Int64Array) -> tuple[PredictedBoxes, frozenset[int]]:
        """Boxes of a scene, and the ticks that were answered; see ``prediction_sources.BoxSource``."""
        number = self._rows.rows(scene)
        columns = {name: values[number] for name, values in self._arrays.items()}
        rows, classes = Rows(str(self.path), number), columns.pop("class")
        if classes.dtype.kind in "iu":
            label = numbered_labels(classes, rows, may_be_empty=True)
        else:
            names, code = np.unique(classes, return_inverse=True)
            label = named_labels(names.tolist(), code, rows, may_be_empty=True)
        return parse_answers(columns, label, rows, self.frame_id, scene, stamps_ns)

    def __reduce__(self) -> tuple[Any, ...]:
        return NpzBoxes, (self.path,)


_KINDS = {"i": "integer", "u": "integer", "f": "float", "U": "text"}
_ALLOWED = {
    "scene": {"text"},
    "class": {"text", "integer"},
    "tick": {"integer"},
    "stamp_ns": {"integer"},
    TRACK_COLUMN: {"integer"},
}


def _require_kind(path: Path, name: str, type_name: str, kind: str) -> None:
    allowed = _ALLOWED.get(name, {"float", "integer"})
    if kind not in allowed:
        wanted = " or ".join(sorted(allowed))
        raise InputError(f"{path}: {name}: is of the type {type_name}; it must be one-dimensional, {wanted}")


def _require_types(path: Path, schema: pa.Schema) -> None:
    require_columns(str(path), schema.names)
    for field in schema:
        if schema.names.count(field.name) > 1:
            raise InputError(f"{path}: {field.name}: there is more than one column of this name")
        if field.name in ALL_COLUMNS and not pa.types.is_null(field.type):
            kinds = {"integer": pa.types.is_integer, "float": pa.types.is_floating, "text": _is_text}
            kind = next((kind for kind, holds in kinds.items() if holds(field.type)), "")
            _require_kind(path, field.name, str(field.type), kind)


def _typed(name: str, table: pa.Table) -> pa.ChunkedArray:
    """A column; pandas and polars store one that holds only nulls without a type."""
    column = table.column(name)
    if not pa.types.is_null(column.type):
        return column
    return column.cast(pa.string() if name in TEXT_COLUMNS else pa.int64() if name in INTEGER_COLUMNS else pa.float64())


def _is_text(kind: pa.DataType) -> bool:
    kind = kind.value_type if pa.types.is_dictionary(kind) else kind
    return any(holds(kind) for holds in (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view))


def _encode_categories(column: pa.ChunkedArray) -> tuple[list[str | None], AnyArray]:
    """Distinct values of a text column, None last, and (N,) index into them."""
    if not pa.types.is_dictionary(column.type):
        column = pc.dictionary_encode(column)
    chunks = column.unify_dictionaries().chunks
    if not chunks:
        return [None], np.zeros(0, np.int64)
    names = chunks[0].dictionary.to_pylist()
    codes = [chunk.indices.cast(pa.int32()).fill_null(len(names)).to_numpy(zero_copy_only=False) for chunk in chunks]
    code = np.concatenate(codes)
    if len(code) and not (code.min() >= 0 and code.max() <= len(names)):
        raise pa.ArrowInvalid("a page of texts is damaged")
    return [*names, None], code


def _parquet_labels(column: pa.ChunkedArray, rows: Rows) -> UInt8Array:
    if pa.types.is_integer(column.type):
        numbers = column.cast(pa.int64()).fill_null(-1).to_numpy()
        return numbered_labels(numbers, rows, may_be_empty=True)
    names, code = _encode_categories(column)
    return named_labels(names, code, rows, may_be_empty=True)


def _npz_rows(path: Path, arrays: dict[str, AnyArray]) -> SceneRows:
    if "scene" not in arrays:
        return SceneRows.from_codes([path.stem], np.zeros(len(arrays["class"]), np.uint8))
    scene = arrays.pop("scene")
    start, stop = runs(scene)
    names, code = np.unique(scene[start], return_inverse=True)
    return SceneRows(names.tolist(), code, start, stop)


def _decode_text(path: Path, name: str, values: AnyArray) -> AnyArray:
    """Decode byte strings as UTF-8; return other values unchanged."""
    try:
        return np.char.decode(values, "utf-8") if values.dtype.kind == "S" else values
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: {name}: is not UTF-8: {error.reason}") from None


def _require_one_text(value: AnyArray, path: Path) -> str:
    if value.size != 1 or value.dtype.kind != "U":
        raise InputError(
            f"{path}: frame_id: has the shape {value.shape} and the type {value.dtype}; it must be one text"
        )
    return str(value.item())


@contextmanager
def _damage_as_input_error(path: Path) -> Iterator[None]:
    """Turn the errors from reading a damaged file into InputError."""
    try:
        yield
    except InputError:
        raise
    except (pa.ArrowException, OSError, *FOREIGN_ERRORS) as error:
        reason = getattr(error, "strerror", None) or str(error).partition("\n")[0]
        raise InputError(f"{path}: cannot be read as Parquet: {reason}") from None
