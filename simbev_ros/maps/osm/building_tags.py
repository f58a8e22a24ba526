"""Interprets the tags of a building or a part of one: heights, roof, materials and colors."""

import numpy as np
import shapely
from PIL import ImageColor

from simbev_ros.maps.land_features import Footprint
from simbev_ros.maps.osm.data import Tags
from simbev_ros.maps.osm.land_rules import land_rules
from simbev_ros.maps.osm.lengths import parse_direction_rad, parse_length_m

_MIN_HEIGHT_M, _MAX_HEIGHT_M = 2.2, 500.0
_MIN_PART_M = 0.5
_ATTIC = 0.5
"""Height of an unknown roof in storeys."""


def footprint_of(outline: shapely.Polygon, tags: Tags) -> Footprint:
    """A building on an outline, as its tags describe it."""
    rules = land_rules()
    rule = rules.buildings.get(tags.get("building", ""), rules.buildings["yes"])
    roof_m = parse_length_m(tags.get("roof:height", "")) or _storeys(tags, "roof:levels") * rules.storey_m
    storeys = _storeys(tags, "building:levels")
    top_m = storeys * rules.storey_m + (roof_m or _ATTIC * rules.storey_m)
    height_m = parse_length_m(tags.get("height", "")) or top_m * (storeys > 0.0) or rule.height_m
    height_m = min(max(height_m, _MIN_HEIGHT_M), _MAX_HEIGHT_M)
    bottom_m = parse_length_m(tags.get("min_height", "")) or _storeys(tags, "building:min_level") * rules.storey_m
    bottom_m = min(bottom_m, height_m - _MIN_PART_M)
    return Footprint(
        outline,
        height_m,
        rule.use,
        tags.get("roof:shape", ""),
        bottom_m=bottom_m,
        roof_height_m=min(roof_m, height_m - bottom_m),
        slope_rad=_slope_rad(outline, tags),
        wall=rules.wall_materials.get(tags.get("building:material", ""), ""),
        color=_color(tags.get("building:colour", "")),
        roof_color=_roof_color(tags),
    )


def _storeys(tags: Tags, key: str) -> float:
    """A number of storeys; 0 if there is none."""
    return parse_length_m(tags.get(key, ""))


def _slope_rad(outline: shapely.Polygon, tags: Tags) -> float:
    """Direction in which the roof falls; NaN if no tag gives it."""
    direction_rad = parse_direction_rad(tags.get("roof:direction", ""))
    if np.isnan(direction_rad) and tags.get("roof:orientation") == "across":
        corners = shapely.get_coordinates(outline.minimum_rotated_rectangle.boundary)
        sides = np.diff(corners[:3], axis=0)
        along = sides[int(np.argmax(np.hypot(*sides.T)))]
        return float(np.arctan2(along[1], along[0]))
    return direction_rad


def _roof_color(tags: Tags) -> int:
    color = _color(tags.get("roof:colour", ""))
    return color if color >= 0 else land_rules().roof_materials.get(tags.get("roof:material", ""), -1)


def _color(text: str) -> int:
    """A color by its CSS name or as #rgb or #rrggbb, as 0xRRGGBB; -1 if it is none."""
    try:
        channels = ImageColor.getrgb(text.strip().replace(" ", "").replace("_", ""))[:3]
    except ValueError:
        return -1
    red, green, blue = (min(max(channel, 0), 255) for channel in channels)  # rgb(999,0,0) is accepted
    return red << 16 | green << 8 | blue
