"""Reads OpenStreetMap PBF through pyosmium; of a large file, only what lies in a box gets into memory.

The coordinates of all nodes go to a temporary file (16 bytes each), where numpy searches them: handing every node of a
country to Python would take a hundred times longer.
"""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_OSM_NODES, MAX_PBF_BYTES, MAX_PBF_RATIO
from simbev_ros.foundation.types import Float64Array, Int64Array, Table
from simbev_ros.maps.osm.box import Box, densest_box
from simbev_ros.maps.osm.elements import OsmElements, Relation
from simbev_ros.maps.osm.xml import MAX_TAG
from simbev_ros.maps.safe_xml import check_readable

if TYPE_CHECKING:
    from osmium import IdTracker

_HEADER = b"\x0a\x09OSMHeader"
_HEADER_START = 4
_NODE = np.dtype([("id", "<i8"), ("x", "<i4"), ("y", "<i4")])
_UNITS_PER_DEG = 10_000_000
_MAX_HEADER_BYTES, _BLOCK_START_BYTES = 0xFFFF, 32
_DATASIZE, _RAW_SIZE = 3, 2
_PIECE = 1 << 22
_MAX_SAMPLES = 4_000_000
_MAX_DENSE_ID = 1 << 36
"""pyosmium's sets of ids take memory for all ids up to the largest; OpenStreetMap's own ids have 34 bits."""


def is_pbf(path: Path) -> bool:
    """Whether a file begins as PBF does."""
    try:
        with path.open("rb") as stream:
            return stream.read(_HEADER_START + len(_HEADER))[_HEADER_START:] == _HEADER
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def read_pbf(path: Path, box: Box | None) -> tuple[OsmElements, Box | None]:
    """Read an OpenStreetMap PBF file.

    Args:
        path: The file.
        box: Only ways with a node in the box are read, complete, with the multipolygons that they belong to; None: all,
            or the densest part of a file that is too large.

    Returns:
        The elements, and the box that they were chosen by.

    Raises:
        InputError: The file is damaged, or has too many nodes in the box.
    """
    check_readable(path, MAX_PBF_BYTES)
    _require_plausible(path)
    with _damage_as_input_error(path):
        try:
            return _read_indexed(path, box)
        except _ForeignIdError:
            return _read_each(path), None


class _ForeignIdError(Exception):
    """An id is not OpenStreetMap's own, so that pyosmium's sets cannot hold it, or only in GiB of memory."""


def _require_own(*ids: int) -> None:
    """Refuse negative ids, as editors give to what is new, and very large ones.

    Raises:
        _ForeignIdError: There is one.
    """
    if any(not 0 <= each <= _MAX_DENSE_ID for each in ids):
        raise _ForeignIdError


def _read_indexed(path: Path, box: Box | None) -> tuple[OsmElements, Box | None]:
    """Read what lies in a box through sets of ids and an index of the nodes, as ``read_pbf`` describes.

    Raises:
        _ForeignIdError: The sets cannot hold an id.
        InputError: The file has too many nodes in the box.
    """
    elements = OsmElements(path, MAX_OSM_NODES)
    with tempfile.TemporaryDirectory(prefix="simbev-osm-") as folder:
        nodes = _index_nodes(path, Path(folder, "nodes"))
        if box is None and len(nodes) > MAX_OSM_NODES:
            box = _densest_part(nodes)
        inside = _ids_within(nodes, box)
        if len(inside) > MAX_OSM_NODES:
            raise InputError(
                f"{path}: bounds: have {len(inside):,} nodes; at most {MAX_OSM_NODES:,} are read; choose a smaller part"
            )
        used = [inside, *_add_ways(path, elements, None if box is None else inside)]
        _add_node_tags(path, elements, None if box is None else inside)
        elements.add_nodes(*_located(nodes, np.unique(np.concatenate(used))))
    return elements, box


def _require_plausible(path: Path) -> None:
    """Refuse a PBF file whose blocks are damaged or declare an implausible size, before nodes are written to disk.

    The layout of blocks is described at https://wiki.openstreetmap.org/wiki/PBF_Format.

    Raises:
        InputError: It is such a file.
    """
    size_bytes, unpacked_bytes = path.stat().st_size, 0
    with path.open("rb") as stream:
        while stream.tell() < size_bytes:
            header = stream.read(int.from_bytes(stream.read(4), "big") & _MAX_HEADER_BYTES)
            block_bytes = _numbers(header).get(_DATASIZE, 0)
            start = stream.read(min(block_bytes, _BLOCK_START_BYTES))
            unpacked_bytes += _numbers(start).get(_RAW_SIZE, block_bytes)
            if not start or block_bytes > size_bytes or stream.seek(block_bytes - len(start), 1) > size_bytes:
                raise InputError(f"{path}: is damaged: a block is cut off")
    if unpacked_bytes > MAX_PBF_RATIO * size_bytes:
        raise InputError(
            f"{path}: unpacks to {unpacked_bytes >> 20} MiB, more than {MAX_PBF_RATIO} times its size, as no map does"
        )


def _numbers(message: bytes) -> dict[int, int]:
    """Integers at the beginning of a protobuf message by field number; texts among them are skipped."""
    found, position = {}, 0
    while position < len(message):
        tag, position = _varint(message, position)
        value, position = _varint(message, position)
        if tag & 7 == 0:
            found[tag >> 3] = value
        else:
            position += value
    return found


def _varint(message: bytes, position: int) -> tuple[int, int]:
    """An integer of a protobuf message, and the position after it."""
    value = shift = 0
    while position < len(message):
        byte = message[position]
        value |= (byte & 0x7F) << shift
        position, shift = position + 1, shift + 7
        if byte < 0x80:
            break
    return value, position


def _read_each(path: Path) -> OsmElements:
    """Read a whole file element by element, which takes all ids; libosmium's writers crash at damaged texts."""
    import osmium

    elements = OsmElements(path, MAX_OSM_NODES)
    element: Any
    for element in osmium.FileProcessor(str(path)):
        tags = _tags(element)
        if element.is_way():
            elements.add_way(element.id, [node.ref for node in element.nodes], tags)
        elif element.is_relation():
            elements.relations.append(Relation(tags, _ways_in(element)))
        elif element.is_node() and element.location.valid():
            elements.add_node(element.id, element.location.lon, element.location.lat)
            elements.node_tags.update({element.id: tags} if tags else {})
    return elements


def _densest_part(nodes: Table) -> Box:
    """The part of a file with the most nodes that may be read."""
    step = -(-len(nodes) // _MAX_SAMPLES)
    degrees = _degrees(nodes[::step])
    degrees = degrees[(np.abs(degrees) <= (180.0, 90.0)).all(axis=1)]
    return densest_box(degrees, np.full(len(degrees), float(step)), MAX_OSM_NODES / 2.0)


def _index_nodes(path: Path, file: Path) -> Table:
    """All nodes of a file, sorted by id, in a file that is mapped into memory."""
    import osmium

    index = osmium.index.create_map(f"sparse_file_array,{file}")
    try:
        osmium.apply(osmium.io.Reader(str(path), osmium.osm.NODE), osmium.NodeLocationsForWays(index))
    finally:
        _close(file)
    count = file.stat().st_size // _NODE.itemsize
    nodes: Table = np.memmap(file, _NODE, "r+", shape=(count,)) if count else np.empty(0, _NODE)
    if any(np.any(np.diff(nodes["id"][k : k + _PIECE + 1]) <= 0) for k in range(0, count, _PIECE)):
        nodes = nodes[np.argsort(nodes["id"], kind="stable")]
    for first in osmium.FileProcessor(str(path), osmium.osm.NODE):  # the index leaves out negative ids
        _require_own(first.id, *nodes["id"][-1:].tolist())
        break
    return nodes


def _close(file: Path) -> None:
    """Close a file that libosmium leaves open, so that its space on the disk is free once it is removed."""
    for link in Path("/proc/self/fd").iterdir():
        with suppress(OSError):  # it is that of the listing itself
            if link.readlink() == file.resolve():
                os.close(int(link.name))


def _ids_within(nodes: Table, box: Box | None) -> Int64Array:
    """Sorted ids of the nodes in a box; without one, of all."""
    found = [np.empty(0, np.int64)]
    for start in range(0, len(nodes), _PIECE):
        piece = nodes[start : start + _PIECE]
        degrees = _degrees(piece)
        valid = (np.abs(degrees) <= (180.0, 90.0)).all(axis=1)
        found.append(piece["id"][valid if box is None else valid & box.contains(degrees)])
    return np.concatenate(found)


def _degrees(nodes: Table) -> Float64Array:
    return np.column_stack([nodes["x"], nodes["y"]]) / _UNITS_PER_DEG


def _located(nodes: Table, ids: Int64Array) -> tuple[Int64Array, Float64Array]:
    """The existing ones of (N,) sorted ids, and their (M, 2) longitudes and latitudes."""
    if not len(nodes):
        return np.empty(0, np.int64), np.empty((0, 2))
    position = np.minimum(np.searchsorted(nodes["id"], ids), len(nodes) - 1)
    found = nodes[position[nodes["id"][position] == ids]]
    degrees = _degrees(found)
    valid = (np.abs(degrees) <= (180.0, 90.0)).all(axis=1)
    return found["id"][valid].astype(np.int64), degrees[valid]


def _add_ways(path: Path, elements: OsmElements, inside: Int64Array | None) -> Iterator[Int64Array]:
    """Add ways with a node inside, None: all, and the relations with such a way; yield the ids of their nodes."""
    import osmium

    known, added = osmium.IdTracker(), set[int]()

    def add(way: Any) -> Int64Array:
        _require_own(way.id)
        known.add_way(way.id)
        added.add(way.id)
        references = [node.ref for node in way.nodes]
        elements.add_way(way.id, references, _tags(way))
        return np.array(references, np.int64)

    ways = osmium.FileProcessor(str(path), osmium.osm.WAY)
    if inside is not None:
        ways = ways.with_filter(_tracker(inside).contains_filter())
    for way in ways:
        yield add(way)
    wanted = _add_relations(path, elements, known) - added
    if wanted:
        _require_own(*wanted)
        for way in osmium.FileProcessor(str(path), osmium.osm.WAY).with_filter(osmium.filter.IdFilter(wanted)):
            yield add(way)


def _add_relations(path: Path, elements: OsmElements, ways: "IdTracker") -> set[int]:
    """Add multipolygons and boundaries with one of the ways; return the ids of all ways of the multipolygons."""
    import osmium

    wanted: set[int] = set()
    kinds = osmium.filter.TagFilter(("type", "multipolygon"), ("type", "boundary"))
    relations = osmium.FileProcessor(str(path), osmium.osm.RELATION).with_filter(kinds)
    relation: Any
    for relation in relations.with_filter(ways.contains_filter()):
        tags = _tags(relation)
        members = _ways_in(relation)
        elements.relations.append(Relation(tags, members))
        if tags["type"] == "multipolygon":
            wanted.update(way for _, way in members)
    return wanted


def _ways_in(relation: Any) -> list[tuple[str, int]]:
    """Role and id of each member of a relation that is a way."""
    return [(member.role, member.ref) for member in relation.members if member.type == "w"]


def _add_node_tags(path: Path, elements: OsmElements, inside: Int64Array | None) -> None:
    import osmium

    nodes = osmium.FileProcessor(str(path), osmium.osm.NODE).with_filter(osmium.filter.EmptyTagFilter())
    if inside is not None:
        nodes = nodes.with_filter(_tracker(inside).id_filter())
    for node in nodes:
        elements.node_tags[node.id] = _tags(node)


def _tracker(nodes: Int64Array) -> "IdTracker":
    """The ids in the form in which pyosmium filters by them."""
    import osmium

    tracker = osmium.IdTracker()
    for node in nodes.tolist():
        tracker.add_node(node)
    return tracker


def _tags(element: Any) -> dict[str, str]:
    return {tag.k[:MAX_TAG]: tag.v[:MAX_TAG] for tag in element.tags}


@contextmanager
def _damage_as_input_error(path: Path) -> Iterator[None]:
    """Convert the errors of pyosmium at a damaged file to InputError."""
    try:
        yield
    except (RuntimeError, ValueError, UnicodeDecodeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: is damaged: {error}") from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror or error}") from None
