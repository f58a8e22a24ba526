"""Dataclasses for the content of a Lanelet2 file, its points in the map frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from xml.etree.ElementTree import Element

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.osm.data import Tags


@dataclass(frozen=True, slots=True, eq=False)
class Linestring:
    """A line or outline.

    Attributes:
        id: Its id in the file.
        nodes: N numbers of its points: the same number for points at the same position.
        points_m: (N, 3) its points, at least two.
        tags: Its tags.
    """

    id: str
    nodes: tuple[int, ...]
    points_m: Float64Array
    tags: Tags


@dataclass(frozen=True, slots=True, eq=False)
class Lanelet:
    """A lanelet as the file describes it.

    Attributes:
        id: Its id in the file.
        left: Its left bound, in either direction.
        right: Its right bound, in either direction.
        centerline: Its center line, if the file has one.
        tags: Its tags.
        regulations: Ids of the regulatory elements that it refers to.
        element: The XML element that it was read from.
    """

    id: str
    left: Linestring
    right: Linestring
    centerline: Linestring | None
    tags: Tags
    regulations: tuple[str, ...]
    element: Element


@dataclass(frozen=True, slots=True, eq=False)
class Regulation:
    """A regulatory element.

    Attributes:
        subtype: Its kind, such as ``traffic_light``.
        tags: Its tags.
        lines: Role → lines in this role.
        lanelets: Role → ids of lanelets in this role.
        element: The XML element that it was read from.
    """

    subtype: str
    tags: Tags
    lines: Mapping[str, tuple[Linestring, ...]]
    lanelets: Mapping[str, tuple[str, ...]]
    element: Element


@dataclass(frozen=True, slots=True, eq=False)
class Area:
    """An area: the (N, 3) corners of its outline, without a repetition of the first, and its tags."""

    outline_m: Float64Array
    tags: Tags


@dataclass(frozen=True, slots=True, eq=False)
class LaneletMap:
    """The content of a Lanelet2 file: elements by id, in the order of the file."""

    lines: Mapping[str, Linestring]
    lanelets: Mapping[str, Lanelet]
    regulations: Mapping[str, Regulation]
    areas: tuple[Area, ...]
