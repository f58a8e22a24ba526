"""Water and zones of a recipe as areas of the map."""

from collections.abc import Iterator, Sequence
from typing import Self

import numpy as np
import shapely
from pydantic import Field, model_validator

from simbev_ros.config.base import Model
from simbev_ros.maps.land_features import Water, Zone
from simbev_ros.maps.plan.heights.profile import Land
from simbev_ros.maps.plan.patterns.road import Place, spline
from simbev_ros.maps.surroundings import SurroundingsRecipe

_OUTLINE_SPACING_M = 20.0


class WaterRecipe(Model):
    """A river or canal along a line, or a lake."""

    line_m: tuple[Place, ...] = Field((), description="of a river: places that it winds through")
    width_m: float = Field(20.0, ge=3, le=500, description="of a river")
    outline_m: tuple[Place, ...] = Field((), description="of a lake: corners, rounded off")
    below_land_m: float = Field(2.0, ge=0.5, le=30, description="of its surface, where the land is lowest")

    @model_validator(mode="after")
    def _line_or_outline(self) -> Self:
        if (len(self.line_m) >= 2) == (len(self.outline_m) >= 3):
            raise ValueError("water needs either line_m, of two places or more, or outline_m, of three or more")
        return self


class ZoneRecipe(Model):
    """Land with a character of its own: a circle, a rectangle or a polygon."""

    circle_m: tuple[float, float, float] | None = Field(None, description="x, y, smallest radius")
    rectangle_m: tuple[float, float, float, float] | None = Field(None, description="west, south, east, north")
    polygon_m: tuple[Place, ...] | None = Field(None, min_length=3)
    surroundings: SurroundingsRecipe

    @model_validator(mode="after")
    def _one_shape(self) -> Self:
        if sum(shape is not None for shape in (self.circle_m, self.rectangle_m, self.polygon_m)) != 1:
            raise ValueError("a zone needs exactly one of circle_m, rectangle_m and polygon_m")
        return self

    @property
    def area(self) -> shapely.Polygon:
        """In the map frame."""
        if self.circle_m is not None:
            return settled_around(*self.circle_m)
        if self.rectangle_m is not None:
            return shapely.box(*self.rectangle_m)
        return shapely.Polygon(self.polygon_m)


def settled_around(x_m: float, y_m: float, radius_m: float) -> shapely.Polygon:
    """A circle with bulges: nothing that people have settled is round."""
    angle_rad = np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False)
    swell = 1.13 + 0.06 * np.sin(2.0 * angle_rad + x_m)
    swell += 0.04 * np.sin(3.0 * angle_rad + y_m) + 0.03 * np.sin(5.0 * angle_rad)
    around = np.column_stack([np.cos(angle_rad), np.sin(angle_rad)])
    return shapely.Polygon([x_m, y_m] + radius_m * swell[:, None] * around)


def zones_of(recipes: Sequence[ZoneRecipe]) -> Iterator[Zone]:
    """Zones in ascending precedence."""
    return (Zone(recipe.area, recipe.surroundings) for recipe in recipes)


def waters_of(recipes: Sequence[WaterRecipe], land: Land) -> Iterator[Water]:
    """Areas of water, each with one level surface."""
    for recipe in recipes:
        if recipe.line_m:
            area = shapely.LineString(spline(np.array(recipe.line_m))).buffer(recipe.width_m / 2.0, cap_style="flat")
        else:
            area = shapely.Polygon(spline(np.array(recipe.outline_m), closed=True))
        yield water_in(area, land, recipe.below_land_m)


def water_in(area: shapely.Polygon, land: Land, below_land_m: float = 2.0) -> Water:
    """Water with a level surface, so far below the lowest land at its shore."""
    shore_m = shapely.get_coordinates(shapely.segmentize(area.exterior, _OUTLINE_SPACING_M))
    return Water(area, round(float(np.min(land(shore_m))) - below_land_m, 2))
