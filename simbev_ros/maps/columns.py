"""Converts between lists of dataclass instances and flat arrays, the storage format of maps."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import StrEnum
from functools import cache
from typing import Any, TypeVar, get_type_hints

import numpy as np
import shapely
from pydantic import BaseModel

from simbev_ros.foundation.types import AnyArray, Float64Array

SPARSE = {"sparse": True}
"""Metadata of a field with the default None, True or False that few maps use."""

_T = TypeVar("_T")
_Columns = dict[str, AnyArray]
_NONE = -1  # number of rows of an array that is None


def to_columns(kind: type[_T], items: Sequence[_T]) -> _Columns:
    """Convert instances of a dataclass to columns, keyed by field name.

    A field with metadata ``SPARSE`` whose values all equal its default is not stored. Fields may be numbers, booleans,
    strings without line breaks, enums, tuples and sets of strings without tabs, float64 arrays (of any length, or None;
    their other axes the same for all instances), polygons, pydantic models, and dataclasses of these.
    """
    columns: _Columns = {"count": np.array(len(items))}
    sparse = _sparse_defaults(kind)
    for name, codec in _codecs(kind).items():
        values = [getattr(item, name) for item in items]
        if name in sparse and all(value is sparse[name] for value in values):
            continue
        written = codec.write(values)
        columns.update({f"{name}.{part}": column for part, column in written.items()})
    return columns


def from_columns(kind: type[_T], columns: Mapping[str, AnyArray]) -> list[_T]:
    """Rebuild the instances from columns written by ``to_columns``; arrays are views of the columns.

    Raises:
        KeyError, ValueError: The columns are not those of this dataclass.
    """
    sparse, count = _sparse_defaults(kind), int(columns["count"])
    values = [
        codec.read(part) if (part := part_of(columns, name)) or name not in sparse else [sparse[name]] * count
        for name, codec in _codecs(kind).items()
    ]
    if any(len(column) != columns["count"] for column in values):
        raise ValueError(f"columns of {kind.__name__} differ in length")
    return list(map(kind, *values))


def part_of(columns: Mapping[str, AnyArray], name: str) -> _Columns:
    """The columns with names that start with ``name.``, keyed without that prefix."""
    return {key.removeprefix(f"{name}."): column for key, column in columns.items() if key.startswith(f"{name}.")}


@dataclass(frozen=True, slots=True)
class _Codec:
    """Converts values of one type to columns and back."""

    write: Callable[[Sequence[Any]], _Columns]
    read: Callable[[Mapping[str, AnyArray]], Sequence[Any]]


def _codecs(kind: Any) -> dict[str, _Codec]:
    """Codecs by field name."""
    hints = get_type_hints(kind)
    return {field.name: _codec(hints[field.name]) for field in fields(kind)}


def _sparse_defaults(kind: Any) -> dict[str, Any]:
    """Defaults of the fields that are stored only if a value differs."""
    return {field.name: field.default for field in fields(kind) if SPARSE.items() <= field.metadata.items()}


@cache
def _codec(annotation: Any) -> _Codec:
    """Codec for a type."""
    if annotation in _CODECS:
        return _CODECS[annotation]
    if issubclass(annotation, StrEnum):
        return _text(str, annotation)
    if issubclass(annotation, BaseModel):
        return _text(annotation.model_dump_json, annotation.model_validate_json)
    if not is_dataclass(annotation):
        raise TypeError(f"no columns for {annotation}")
    kind: Any = annotation
    return _Codec(lambda items: to_columns(kind, items), lambda columns: from_columns(kind, columns))


def _numbers(dtype: type) -> _Codec:
    """Codec for scalars of one dtype."""
    return _Codec(lambda values: {"value": np.array(values, dtype)}, lambda columns: columns["value"].tolist())


def _text(encode: Callable[[Any], str], decode: Callable[[str], Any]) -> _Codec:
    """Codec for values encoded as strings; each distinct string is stored once, and its decoded value is shared."""

    def write(values: Sequence[Any]) -> _Columns:
        text_index: dict[str, int] = {}
        row = [text_index.setdefault(encode(value), len(text_index)) for value in values]
        return {"row": np.array(row, np.int32), "text": np.frombuffer("\n".join(text_index).encode(), np.uint8)}

    def read(columns: Mapping[str, AnyArray]) -> Sequence[Any]:
        rows = columns["row"].tolist()
        distinct = [decode(text) for text in columns["text"].tobytes().decode().split("\n")] if rows else []
        return [distinct[row] for row in rows]

    return _Codec(write, read)


def _write_arrays(values: Sequence[Float64Array | None]) -> _Columns:
    """Arrays concatenated along the first axis, and the length of each."""
    arrays = [value for value in values if value is not None]
    tail = arrays[0].shape[1:] if arrays else ()
    return {
        "rows": np.array([_NONE if value is None else len(value) for value in values], np.int32),
        "value": np.concatenate([np.empty((0, *tail)), *arrays]),
    }


def _read_arrays(columns: Mapping[str, AnyArray]) -> Sequence[Float64Array | None]:
    rows, value = columns["rows"], columns["value"]
    ends = np.cumsum(np.maximum(rows, 0)).tolist()
    if (ends[-1] if ends else 0) != len(value):
        raise ValueError("arrays are not as long as their parts")
    pairs = zip(rows.tolist(), ends, strict=True)
    return [None if count == _NONE else value[end - count : end] for count, end in pairs]


_CODECS: dict[Any, _Codec] = {
    float: _numbers(np.float64),
    int: _numbers(np.int64),
    bool: _numbers(np.bool_),
    str: _text(str, str),
    tuple[str, ...]: _text("\t".join, lambda text: tuple(text.split("\t")) if text else ()),
    frozenset[str]: _text(
        lambda items: "\t".join(sorted(items)), lambda text: frozenset(text.split("\t")) if text else frozenset()
    ),
    Float64Array: _Codec(_write_arrays, _read_arrays),
    Float64Array | None: _Codec(_write_arrays, _read_arrays),
    shapely.Polygon: _text(lambda polygon: shapely.to_wkb(polygon, hex=True), shapely.from_wkb),
}
