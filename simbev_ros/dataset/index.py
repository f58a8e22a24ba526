"""The index of a dataset: a Parquet file with the settings, weather and contents of each finished scene."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pydantic import BaseModel, Field, ValidationError

from simbev_ros.config.base import first_problem
from simbev_ros.config.names import NAME_PATTERN, Name
from simbev_ros.config.scenario import Split
from simbev_ros.dataset.index_row import Row, index_row
from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError, InputError
from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.input_file import require_file
from simbev_ros.foundation.files.limits import (
    MAX_ACTORS,
    MAX_SCENE_NUMBER,
    MAX_SCENE_TICKS,
    max_unpacked_bytes,
    require_unpacked_size,
)
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.foundation.process_limits import describe_shortage
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.recording.layout import INDEX_FILE, SCENES_FOLDER, bytes_of
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import FORMAT

_MAX_ROWS, _GROUP_ROWS = MAX_SCENE_NUMBER + 1, 1 << 13
_LARGEST = {
    **dict.fromkeys(("ticks", "recorded_ticks"), MAX_SCENE_TICKS),
    **dict.fromkeys(("vehicles", "pedestrians"), MAX_ACTORS),
    "number": MAX_SCENE_NUMBER,
}
"""Largest value of columns that others count with."""
LATER_COLUMNS: dict[str, Any] = {}
"""Columns that came after the first index of format 1, each with the value that it has for rows from before."""
_REBUILD_HINT = "delete it, and simbev generate rebuilds it"


class _RowNames(BaseModel):
    """The columns of a row that paths and pages are made from."""

    path: Annotated[str, Field(pattern=f"^{SCENES_FOLDER}/{NAME_PATTERN}/{NAME_PATTERN}$")]
    name: Name
    map: Name
    split: Split


def read_index(dataset: AnyPath) -> list[Row]:
    """Read the rows of a dataset's index, by ascending scene number; an empty list if the dataset has no index.

    Raises:
        InputError: The file is damaged, of another version, exceeds a limit, or has a name that is not allowed.
    """
    return load_index(dataset).to_pylist()


def load_index(dataset: AnyPath) -> pa.Table:
    """Read a dataset's index as a table, which takes a fraction of the memory of its rows; empty if there is no index.

    Raises:
        InputError: See ``read_index``.
    """
    path, source = _open_index(dataset)
    try:
        return index_table([]) if source is None else read_rows(path, source)
    except InputError:
        if not isinstance(dataset, ObjectPath):
            raise
        # An object that is replaced between the requests for its size and for its bytes is read truncated.
        source = _open_index(dataset)[1]
        return index_table([]) if source is None else read_rows(path, source)


def read_rows(path: AnyPath, source: Path | pa.BufferReader) -> pa.Table:
    """Read rows of an index, and check them.

    Args:
        path: Path for messages.
        source: What to read.

    Raises:
        InputError: See ``read_index``.
    """
    try:
        file = pq.ParquetFile(source)
        _require_format(path, file)
        known = _require_columns(path, file)
        table = pq.read_table(source, columns=known, use_threads=False)  # threads would keep their memory
        table.validate(full=True)  # texts are UTF-8
        for name, largest in _LARGEST.items():
            _require_range(path, name, table.column(name), largest)
        for batch in table.select(["number", *_RowNames.model_fields]).to_batches(_GROUP_ROWS):
            _require_names(path, batch.to_pylist())
    except InputError:
        raise
    except (pa.ArrowException, OSError, *FOREIGN_ERRORS) as error:
        problem = describe_shortage(error) or f"{error}; {_REBUILD_HINT}"
        raise InputError(f"{path}: {problem}") from None
    return _with_later_columns(table)


def index_table(rows: Iterable[Row]) -> pa.Table:
    """The table of some rows."""
    return pa.Table.from_pylist(list(rows), _schema())


def with_rows(table: pa.Table, added: pa.Table) -> pa.Table:
    """A table with more rows at its end, which replace those with the same numbers; the rest is not copied."""
    is_replaced = pc.is_in(table["number"], pa.array(added["number"].to_pylist(), pa.int64()))
    others = table.filter(pc.invert(is_replaced)) if pc.any(is_replaced).as_py() else table
    return pa.concat_tables([others, added])


def indexed_bags(dataset: ObjectPath) -> dict[ObjectPath, Row]:
    """Rows of the index of a dataset in an object store by bag, sorted by name: the scenes that exist.

    Raises:
        InputError: The index is damaged, or the store cannot be reached or refuses access.
    """
    rows = {dataset / row["path"]: row for row in read_index(dataset)}
    return {bag: rows[bag] for bag in sorted(rows)}


def _open_index(dataset: AnyPath) -> tuple[AnyPath, Path | pa.BufferReader | None]:
    """Path of a dataset's index, and what to read it from: an object is read whole, at once. None: there is none."""
    if isinstance(dataset, ObjectPath):
        index = dataset / INDEX_FILE
        try:
            return index, pa.BufferReader(index.read_bytes(max_unpacked_bytes()))
        except FileNotFoundError:
            return index, None
    path = path_inside(dataset, INDEX_FILE)
    if not path.exists():
        return path, None
    require_file(path)
    return path, path


def _require_format(path: AnyPath, file: pq.ParquetFile) -> None:
    """Raise InputError if a newer version has written the index."""
    if "format" in file.schema_arrow.names:
        newest = pc.max(file.read(["format"], use_threads=False)["format"]).as_py()
        if newest is not None and newest > FORMAT:
            raise InputError(f"{path}: format: a newer simbev_ros wrote it; allowed: 1 to {FORMAT}, not {newest}")


def _require_columns(path: AnyPath, file: pq.ParquetFile) -> list[str]:
    """Names of the columns of an index that this version knows; others are ignored.

    Raises:
        InputError: The index lacks a column without a default, has one of another type, or is too large to be read.
    """
    found, defaults = {field.name: field.type for field in file.schema_arrow}, _defaults()
    for column in _schema():
        if column.name not in found and column.name in defaults:
            continue
        if found.get(column.name) != column.type:
            raise InputError(
                f"{path}: it is not an index of this version, which has a column {column.name} of the type "
                f"{column.type}; {_REBUILD_HINT}"
            )
    if file.metadata.num_rows > _MAX_ROWS:
        raise InputError(
            f"{path}: it has {file.metadata.num_rows:,} rows; a dataset has at most {_MAX_ROWS:,} scenes; "
            f"{_REBUILD_HINT}"
        )
    groups = range(file.metadata.num_row_groups)
    require_unpacked_size(sum(file.metadata.row_group(group).total_byte_size for group in groups), f"{path}: it")
    return [name for name in _schema().names if name in found]


def _with_later_columns(table: pa.Table) -> pa.Table:
    """A table with all columns of this version; those that it lacks have their defaults."""
    defaults = _defaults()
    for column in _schema():
        if column.name not in table.column_names:
            table = table.append_column(column, pa.repeat(pa.scalar(defaults[column.name], column.type), len(table)))
    table = table.select(_schema().names)
    return table.set_column(0, "format", pa.repeat(pa.scalar(FORMAT, pa.int64()), len(table)))


def _defaults() -> dict[str, Any]:
    """Values of columns that came later in an index that lacks them."""
    later = {name: field.default for name, field in Weather.model_fields.items() if not field.is_required()}
    return {**LATER_COLUMNS, **later, **dict.fromkeys(f"final_{name}" for name in later)}


def _require_range(path: AnyPath, name: str, values: pa.ChunkedArray, largest: int) -> None:
    """Raise InputError if a number of an index is missing, negative or too large."""
    if values.null_count:
        raise InputError(f"{path}: {name}: a value is missing; {_REBUILD_HINT}")
    wrong = values.filter(pc.or_(pc.less(values, 0), pc.greater(values, largest)))
    if len(wrong):
        raise InputError(f"{path}: {name}: is {wrong[0].as_py()}; allowed: 0 to {largest}; {_REBUILD_HINT}")


def _require_names(path: AnyPath, rows: Iterable[Row]) -> None:
    """Raise InputError if a path or a name in one of the rows is not allowed."""
    for row in rows:
        try:
            _RowNames.model_validate(row)
        except ValidationError as error:
            raise InputError(f"{path}: scene {row['number']}: {first_problem(error)}; {_REBUILD_HINT}") from None


def save_index(dataset: AnyPath, table: pa.Table) -> None:
    """Write the index atomically, sorted by the scenes' numbers.

    Raises:
        InputError: It cannot be written.
    """
    path = dataset / INDEX_FILE
    with write_errors(path):
        write_whole(path, packed_rows(table))
    pa.default_memory_pool().release_unused()


def packed_rows(table: pa.Table) -> bytes:
    """The content of a file with the rows of a table, by ascending number; parts of the table are copied in turn."""
    content = pa.BufferOutputStream()
    order = pc.sort_indices(table, [("number", "ascending")])
    with pq.ParquetWriter(content, table.schema) as writer:
        for begin in range(0, max(len(table), 1), _GROUP_ROWS):
            writer.write_table(table.take(order.slice(begin, _GROUP_ROWS)).combine_chunks())
    return content.getvalue().to_pybytes()


def update_index(dataset: Path, bags: Iterable[Path]) -> tuple[pa.Table, dict[Path, str]]:
    """Write the index of finished bags, with new rows for bags that are not in it or have changed.

    Returns:
        The index, in any order, and the problems of bags that cannot be indexed, by bag.

    Raises:
        InputError: The index is damaged, or cannot be written.
    """
    before = load_index(dataset)
    paths, sizes = (before.column(name).to_pylist() for name in ("path", "bytes"))
    known = {path: (index, size) for index, (path, size) in enumerate(zip(paths, sizes, strict=True))}
    kept, added, damaged = list[int](), list[Row](), dict[Path, str]()
    for bag in bags:
        index, size = known.get(str(bag.relative_to(dataset)), (-1, -1))
        try:
            if size == bytes_of(bag):
                kept.append(index)
            else:
                added.append(index_row(bag, dataset))
        except BagError as error:
            damaged[bag] = str(error).removeprefix(f"{bag}: ")
    after = before if len(kept) == len(before) else before.take(pa.array(kept, pa.int64()))
    if added:
        after = pa.concat_tables([after, index_table(added)])
    if after is not before:
        save_index(dataset, after)
    return after, damaged


def _schema() -> pa.Schema:
    """Arrow schema of the index: columns and their types."""
    texts = ("path", "name", "map", "split", "ego_blueprint", "ended", "sha256", "config_sha256", "simbev_ros")
    numbers = ("tick_s", "walker_cross_factor", "ego_way_m", *_WEATHER, *(f"final_{name}" for name in _WEATHER))
    counts = ("number", "seed", "ticks", "recorded_ticks", "vehicles", "pedestrians", "accidents", "work_zones")
    contents = (
        "cameras",
        "messages",
        "objects",
        *(f"{kind}_{name}" for kind in ("boxes", "valid") for name in BOX_CLASSES),
    )
    return pa.schema(
        [
            ("format", pa.int64()),
            *((name, pa.string()) for name in texts),
            ("complete", pa.bool_()),
            *((name, pa.int64()) for name in (*counts, *contents, "bytes")),
            *((name, pa.float64()) for name in numbers),
        ]
    )


_WEATHER = tuple(Weather.model_fields)
