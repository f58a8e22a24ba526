"""The index of a dataset: a Parquet file with the settings, weather and contents of each finished scene."""

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
from pydantic import BaseModel, Field, ValidationError

from simbev_ros import __version__
from simbev_ros.config.base import first_problem
from simbev_ros.config.camera import Camera
from simbev_ros.config.names import NAME_PATTERN, Name
from simbev_ros.config.scenario import Split
from simbev_ros.confined_paths import path_inside
from simbev_ros.errors import BagError, InputError
from simbev_ros.input_file import require_file
from simbev_ros.limits import (
    MAX_ACTORS,
    MAX_SCENE_NUMBER,
    MAX_SCENE_TICKS,
    max_unpacked_bytes,
    require_unpacked_size,
)
from simbev_ros.object_store.object_path import AnyPath, ObjectPath
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, INDEX_FILE, SCENES_FOLDER, bytes_of, mcap_files, scene_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.whole_files import whole_file, write_errors
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.weather import Weather
from simbev_ros.semantics import BOX_CLASSES
from simbev_ros.units import NS_PER_S

_HASHED_BYTES = 1 << 22
_MAX_ROWS = MAX_SCENE_NUMBER + 1
_LARGEST = {
    **dict.fromkeys(("ticks", "recorded_ticks"), MAX_SCENE_TICKS),
    **dict.fromkeys(("vehicles", "pedestrians"), MAX_ACTORS),
    "number": MAX_SCENE_NUMBER,
}
"""Largest value of columns that others count with."""
_REBUILD_HINT = "delete it, and simbev generate rebuilds it"

Row = dict[str, Any]


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
    path, source = _open_index(dataset)
    if source is None:
        return []
    try:
        _require_columns(path, pq.ParquetFile(source))
        table = pq.read_table(source, columns=_schema().names)
        for name, largest in _LARGEST.items():
            _require_range(path, name, table.column(name), largest)
        rows = table.to_pylist()
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: {error}; {_REBUILD_HINT}") from None
    for row in rows:
        try:
            _RowNames.model_validate(row)
        except ValidationError as error:
            raise InputError(f"{path}: scene {row['number']}: {first_problem(error)}; {_REBUILD_HINT}") from None
    return rows


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


def _require_columns(path: AnyPath, file: pq.ParquetFile) -> None:
    """Raise InputError if an index lacks a column, has one of another type, or is too large to be read."""
    found = {field.name: field.type for field in file.schema_arrow}
    for column in _schema():
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


def _require_range(path: AnyPath, name: str, values: pa.ChunkedArray, largest: int) -> None:
    """Raise InputError if a number of an index is missing, negative or too large."""
    if values.null_count:
        raise InputError(f"{path}: {name}: a value is missing; {_REBUILD_HINT}")
    wrong = values.filter(pc.or_(pc.less(values, 0), pc.greater(values, largest)))
    if len(wrong):
        raise InputError(f"{path}: {name}: is {wrong[0].as_py()}; allowed: 0 to {largest}; {_REBUILD_HINT}")


def write_index(dataset: Path, rows: Iterable[Row]) -> None:
    """Write the index atomically.

    Raises:
        InputError: It cannot be written.
    """
    path = dataset / INDEX_FILE
    with write_errors(path), whole_file(path) as unfinished:
        pq.write_table(pa.Table.from_pylist(sorted(rows, key=lambda row: row["number"]), _schema()), unfinished)


def update_index(dataset: Path, bags: Sequence[Path]) -> tuple[list[Row], dict[Path, str]]:
    """Write the index of finished bags, with new rows for bags that are not in it or have changed.

    Returns:
        The rows, and the problems of bags that cannot be indexed, by bag.

    Raises:
        InputError: The index is damaged, or cannot be written.
    """
    before = read_index(dataset)
    known, rows, damaged = {row["path"]: row for row in before}, list[Row](), dict[Path, str]()
    for bag in bags:
        row = known.get(str(bag.relative_to(dataset)))
        try:
            rows.append(row if row is not None and row["bytes"] == bytes_of(bag) else index_row(bag, dataset))
        except BagError as error:
            damaged[bag] = str(error).removeprefix(f"{bag}: ")
    if rows != before:
        write_index(dataset, rows)
    return rows, damaged


def index_row(bag_path: Path, dataset: Path) -> Row:
    """Index row of a finished bag.

    Raises:
        BagError: The bag cannot be read, is cut off, or holds another scene than its name says.
    """
    with SceneBag(bag_path) as bag:
        spec = bag.spec
        if spec is None:
            raise BagError(f"{bag_path}: it holds no scene")
        if not bag.closed:
            raise BagError(f"{bag_path}: it is cut off")
        if bag_path != scene_folder(dataset, spec.split, spec.name):
            raise BagError(f"{bag_path}: it holds scene {spec.split}/{spec.name}")
        facts = bag.custom_data
        return {
            "path": str(bag_path.relative_to(dataset)),
            **_settings(spec),
            **_weather("", spec.weather),
            **_weather("final_", spec.final_weather),
            **_content(bag),
            "ended": facts.get("ended", ""),
            "complete": facts.get("complete") == "true",
            "recorded_ticks": bag.recorded_ticks or spec.ticks,
            "bytes": bytes_of(bag_path),
            "sha256": sha256_of(bag_path),
            "config_sha256": hashlib.sha256(bag.attachments.get(CONFIG_ATTACHMENT, b"")).hexdigest(),
            "simbev_ros": __version__,
        }


def sha256_of(bag: Path) -> str:
    """Hexadecimal SHA-256 of the concatenated bytes of a bag's MCAP files.

    Raises:
        BagError: There is no bag.
    """
    digest = hashlib.sha256()
    for file in mcap_files(bag):
        with file.open("rb") as stream:
            while block := stream.read(_HASHED_BYTES):
                digest.update(block)
    return digest.hexdigest()


def _settings(spec: SceneSpec) -> Row:
    kinds = [hazard.kind for hazard in spec.hazards]
    return {
        "name": spec.name,
        "number": spec.number,
        "map": spec.map.name,
        "split": spec.split,
        "seed": spec.seed,
        "tick_s": spec.tick_ns / NS_PER_S,
        "ticks": spec.ticks,
        "vehicles": len(spec.vehicles),
        "pedestrians": len(spec.pedestrians),
        "accidents": sum(kind == "accident" for kind in kinds),
        "work_zones": sum(kind != "accident" for kind in kinds),
        "walker_cross_factor": spec.walker_cross_factor,
        "ego_blueprint": spec.vehicles[0].blueprint,
        "cameras": len(spec.rig.of_type(Camera)),
    }


def _weather(prefix: str, weather: Weather | None) -> Row:
    return {f"{prefix}{name}": None if weather is None else getattr(weather, name) for name in Weather.model_fields}


def _content(bag: SceneBag) -> Row:
    """Counts of messages, objects and boxes, and the length of the ego's path."""
    counts = np.zeros((2, len(BOX_CLASSES)), np.int64)
    ids: set[int] = set()
    positions_m = []
    topics = [name for name in bag.topics if name.endswith(("/boxes", "/odom")) and name.count("/") == 2]
    for message in bag.messages(topics):
        if message.topic.endswith("/odom"):
            position = bag.decode(message).pose.pose.position
            positions_m.append((position.x, position.y, position.z))
            continue
        table = point_array(bag.decode(message))
        counts += [np.bincount(table["class"][rows], minlength=len(BOX_CLASSES)) for rows in (..., table["valid"] > 0)]
        ids.update(table["id"].tolist())
    steps_m = np.diff(np.array(positions_m).reshape(-1, 3), axis=0)
    return {
        "messages": sum(len(topic.stamps_ns) for topic in bag.topics.values()),
        "objects": len(ids),
        "ego_way_m": float(np.linalg.norm(steps_m, axis=1).sum()),
        **{f"boxes_{name}": int(count) for name, count in zip(BOX_CLASSES, counts[0], strict=True)},
        **{f"valid_{name}": int(count) for name, count in zip(BOX_CLASSES, counts[1], strict=True)},
    }


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
            *((name, pa.string()) for name in texts),
            ("complete", pa.bool_()),
            *((name, pa.int64()) for name in (*counts, *contents, "bytes")),
            *((name, pa.float64()) for name in numbers),
        ]
    )


_WEATHER = tuple(Weather.model_fields)
