"""Markers of a MarkerArray in serialized form, filled in by columns.

Solids of one namespace differ in a few numbers only, and lines are mostly points. So one marker is serialized as a
template; numbers are put into its copies, without a message object for each: several times faster, the same bytes.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from simbev_ros.drawing.displays.messages import MARKERS, build, points, serialize
from simbev_ros.foundation.types import Float64Array, Int64Array, UInt8Array

_ENCAPSULATION = b"\x00\x01\x00\x00"
"""CDR's header, little-endian, which alignment does not count."""
_FIRST_POSITION = 4
"""Position of the first marker in the body of a MarkerArray, after their number."""
_ALIGNMENT, _LARGEST_ALIGNMENT = 4, 8
"""Of a marker's first field, and of float64."""
_STAMP_BYTES, _KIND_BYTES, _GEOMETRY_BYTES, _COLOR_BYTES, _LIFETIME_BYTES = 8, 12, 80, 16, 8


@dataclass(frozen=True, slots=True)
class Solids:
    """(N,) markers of one kind that differ in namespace, place, size and color.

    Attributes:
        kind: Marker.type: a cube, or a sphere inscribed in one.
        names: Namespace of each.
        identities: (N,) ids.
        positions_m: (N, 3) centers.
        xyzw: (N, 4) orientations.
        sizes_m: (N, 3) edges.
        rgba: (N, 4) colors, 0..1.
    """

    kind: int
    names: Sequence[str]
    identities: Int64Array
    positions_m: Float64Array
    xyzw: Float64Array
    sizes_m: Float64Array
    rgba: Float64Array

    def serialize(self, header: Any, position: int) -> list[bytes]:
        """The markers one by one, with this header; the first one begins at a position in the body of the message."""
        groups = dict[_Template, list[int]]()
        for index, name in enumerate(self.names):
            template = _template(self.kind, header.frame_id, name, position % _LARGEST_ALIGNMENT)
            groups.setdefault(template, []).append(index)
            position += _padded(template.dtype.itemsize)
        geometry = np.hstack([self.positions_m, self.xyzw, self.sizes_m])
        markers = [b""] * len(self.names)
        for template, indices in groups.items():
            copies = np.tile(template.marker, len(indices)).view(template.dtype)
            copies["stamp"] = header.stamp.sec, header.stamp.nanosec
            copies["id"], copies["geometry"] = self.identities[indices], geometry[indices]
            copies["color"] = self.rgba[indices]
            for index, copy in zip(indices, copies, strict=True):
                markers[index] = copy.tobytes()
        return markers


@dataclass(frozen=True, slots=True)
class Lines:
    """A marker that consists of points.

    Attributes:
        marker: The message without its points.
        points_m: (N, 3) the points, at least one.
    """

    marker: Any
    points_m: Float64Array

    def serialize(self, position: int) -> bytes:
        """The marker, which begins at a position in the body of the message."""
        marker, phase = self.marker, position % _LARGEST_ALIGNMENT
        marker.points = points(self.points_m[:1])
        short = _serialized_marker(marker, phase)
        _, geometry = _positions(marker.header.frame_id, marker.ns, phase)
        count = _padded(geometry + _GEOMETRY_BYTES + _COLOR_BYTES + _LIFETIME_BYTES + 1) - phase
        start = _padded(count + phase + 4, _LARGEST_ALIGNMENT) - phase
        number, content = len(self.points_m).to_bytes(4, "little"), self.points_m.astype("<f8").tobytes()
        return b"".join([short[:count], number, short[count + 4 : start], content, short[start + 24 :]])


def serialized_markers(header: Any, parts: Sequence[Any]) -> bytes:
    """A MarkerArray of marker messages, ``Solids`` and ``Lines``; the header is that of solids."""
    markers, position = list[bytes](), _FIRST_POSITION
    for part in parts:
        match part:
            case Solids():
                added = part.serialize(header, position)
            case Lines():
                added = [part.serialize(position)]
            case _:
                added = [_serialized_marker(part, position % _LARGEST_ALIGNMENT)]
        markers += added
        position += sum(_padded(len(marker)) for marker in added)
    apart = [marker.ljust(_padded(len(marker)), b"\0") for marker in markers[:-1]]
    return b"".join([_ENCAPSULATION, len(markers).to_bytes(4, "little"), *apart, *markers[-1:]])


@dataclass(frozen=True, slots=True, eq=False)
class _Template:
    """A serialized marker, as bytes, and where its numbers are."""

    marker: UInt8Array
    dtype: np.dtype[np.void]


@lru_cache(maxsize=512)
def _template(kind: int, frame: str, name: str, phase: int) -> _Template:
    """The template of a solid with this namespace that begins at a phase."""
    header = build("std_msgs/msg/Header", frame_id=frame)
    marker = _serialized_marker(build("visualization_msgs/msg/Marker", header=header, ns=name, type=kind), phase)
    identity, geometry = _positions(frame, name, phase)
    offsets = [0, identity - phase, geometry - phase, geometry - phase + _GEOMETRY_BYTES]
    names, formats = ["stamp", "id", "geometry", "color"], ["2<u4", "<i4", "10<f8", "4<f4"]
    dtype = np.dtype({"names": names, "formats": formats, "offsets": offsets, "itemsize": len(marker)})
    return _Template(np.frombuffer(marker, np.uint8), dtype)


def _positions(frame: str, name: str, phase: int) -> tuple[int, int]:
    """Positions of the id and of the pose in a marker that begins at a phase; scale and color follow the pose."""
    end = phase + _STAMP_BYTES
    for text in (frame, name):
        end = _padded(end) + 4 + len(text.encode()) + 1
    identity = _padded(end)
    return identity, _padded(identity + _KIND_BYTES, _LARGEST_ALIGNMENT)


def _serialized_marker(marker: Any, phase: int) -> bytes:
    """A message as it stands in an array of markers, at a position that is a multiple of eight bytes plus a phase."""
    others, start = _before(phase)
    return serialize(build(MARKERS, markers=[*others, marker]))[len(_ENCAPSULATION) + start :]


@lru_cache
def _before(phase: int) -> tuple[list[Any], int]:
    """Markers before one that begins at a phase, and its position."""
    for length in range(_LARGEST_ALIGNMENT):
        others = [build("visualization_msgs/msg/Marker", ns="x" * length)]
        position = _padded(len(serialize(build(MARKERS, markers=others))) - len(_ENCAPSULATION))
        if position % _LARGEST_ALIGNMENT == phase:
            return others, position
    raise AssertionError(f"no marker begins at {phase}")


def _padded(position: int, alignment: int = _ALIGNMENT) -> int:
    """The first aligned position from this one on."""
    return -(-position // alignment) * alignment
