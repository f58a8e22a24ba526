"""Reads what stands beside the roads of an OpenDRIVE file: buildings, barriers, poles, trees and other objects."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Literal
from xml.etree.ElementTree import Element

import numpy as np
import shapely
from pydantic import Field, TypeAdapter

from simbev_ros.config.base import Model
from simbev_ros.foundation.files.limits import MAX_MAP_OBJECTS
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.land_features import POINT_KINDS, Footprint, MapObject, ObjectKind
from simbev_ros.maps.opendrive.borders import points_m
from simbev_ros.maps.opendrive.object_shapes import (
    Placement,
    copies_of,
    heading_rad,
    iter_objects,
    outer_outline,
    outline_m,
    placement_of,
    sweeps_of,
)
from simbev_ros.maps.opendrive.reading.attributes import Malformed, number
from simbev_ros.maps.opendrive.reading.document import Document, Road

_MIN_BUILDING_M2 = 1.0


class ObjectType(Model):
    """Meaning of an OpenDRIVE object type, and its size where the file gives none; see object_types.yaml."""

    kind: ObjectKind | Literal["building"]
    length_m: float = Field(0.0, ge=0)
    width_m: float = Field(0.0, ge=0)
    height_m: float = Field(0.0, ge=0)


@lru_cache(maxsize=1)
def object_types() -> Mapping[str, ObjectType]:
    """Load object_types.yaml."""
    table = load_table("simbev_ros.maps.opendrive", "object_types.yaml")
    return TypeAdapter(dict[str, ObjectType]).validate_python(table)


def objects_of(document: Document, notes: Findings) -> tuple[tuple[MapObject, ...], tuple[Footprint, ...]]:
    """The objects and the buildings of a document; unreadable ones are left out with a note."""
    objects: list[MapObject] = []
    buildings: list[Footprint] = []
    for road, element in iter_objects(document):
        kind = _type_of(element)
        if kind is None:
            continue
        try:
            made = list(_solids(road, element, kind))
        except Malformed as problem:
            notes.left_out("an object that cannot be read is left out", element, str(problem))
            continue
        if len(objects) + len(buildings) + len(made) > MAX_MAP_OBJECTS:
            notes.left_out(f"objects beyond the first {MAX_MAP_OBJECTS} are left out", element)
            break
        if kind.kind == "building":
            buildings += _footprints(made)
        else:
            objects += made
    return tuple(objects), tuple(buildings)


def _type_of(element: Element) -> ObjectType | None:
    """The entry of the table for an object's type and subtype."""
    name, subtype = (element.get(key, "").lower() for key in ("type", "subtype"))
    return object_types().get(f"{name}/{subtype}") or object_types().get(name)


def _solids(road: Road, element: Element, kind: ObjectType) -> Iterator[MapObject]:
    """One object for each copy and each stretch of an element."""
    if kind.kind in POINT_KINDS:
        for place in copies_of(road, element) or [placement_of(element)]:
            foot_m = points_m(road, np.array([place.s_m]), np.array([place.t_m]))
            yaw_rad = heading_rad(road, element, place.s_m) if element.get("hdg") else np.nan
            yield MapObject(ObjectKind(kind.kind), foot_m, place.height_m, place.bottom_m, yaw_rad)
        return
    known = ObjectKind.OBSTACLE if kind.kind == "building" else ObjectKind(kind.kind)
    for place, band_m in sweeps_of(road, element, kind.width_m):
        height_m = place.height_m or _corner_height_m(element) or kind.height_m
        yield MapObject(known, band_m, height_m, place.bottom_m)
    for place in copies_of(road, element):
        yield _solid(road, element, known, _sized(place, kind))


def _sized(place: Placement, kind: ObjectType) -> Placement:
    """A placement with the usual size of its type where the file gives none."""
    return replace(
        place,
        length_m=place.length_m or kind.length_m,
        width_m=place.width_m or kind.width_m,
        height_m=place.height_m or kind.height_m,
    )


def _solid(road: Road, element: Element, kind: ObjectKind, place: Placement) -> MapObject:
    """An object that fills its outline."""
    corners_m = outline_m(road, element, place)
    surface_m = points_m(road, np.array([place.s_m]), np.array([place.t_m]))[0, 2]
    bottom_m = float(corners_m[:, 2].min() - surface_m)
    corners_m[:, 2] = surface_m
    height_m = place.height_m
    if outer_outline(element) is not None:
        height_m = _corner_height_m(element) or number(element, "height", 0.0) or height_m
    return MapObject(kind, np.concatenate([corners_m, corners_m[:1]]), height_m, bottom_m)


def _corner_height_m(element: Element) -> float:
    """Largest height of the corners of an object's outline; 0 if they have none."""
    outline = outer_outline(element)
    return max((number(corner, "height", 0.0) for corner in outline), default=0.0) if outline is not None else 0.0


def _footprints(made: list[MapObject]) -> Iterator[Footprint]:
    """Buildings on the outlines of objects."""
    for item in made:
        outline = valid_outline(item.points_m)
        if outline.area >= _MIN_BUILDING_M2:
            yield Footprint(outline, item.bottom_m + item.height_m)


def valid_outline(points_m: Float64Array) -> shapely.Polygon:
    """The largest valid part of the polygon through (N, 2+) points; empty if it has no area."""
    area = shapely.make_valid(shapely.Polygon(points_m[:, :2]))
    parts = [part for part in shapely.get_parts(shapely.get_parts(area)) if part.geom_type == "Polygon"]
    return max(parts, key=lambda part: part.area, default=shapely.Polygon())
