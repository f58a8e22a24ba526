"""The viaduct pattern of a town recipe: a city motorway on pillars above earlier streets, with ramps to some."""

from dataclasses import replace
from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.plan.curves import round_corners
from simbev_ros.maps.plan.draft import Draft, DraftRoad
from simbev_ros.maps.plan.lines import stations_m
from simbev_ros.maps.plan.patterns.carriageway import Carriageway
from simbev_ros.maps.plan.patterns.interchange import add_entry_ramp, add_exit_ramp
from simbev_ros.maps.plan.patterns.motorway import DualCarriageway, MotorwayClass
from simbev_ros.maps.plan.patterns.road import PointXY

_LAYER = 1


class Diamond(Model):
    """Ramps between both carriageways and a street that passes below."""

    near_m: PointXY = Field(description="position at which the street passes below")
    street: str = Field(description="name of its road")
    beside_m: float = Field(20.0, ge=8, le=100, description="from the lanes' outer edge to where street and ramps meet")
    run_m: float = Field(230.0, ge=150, le=600, description="length of each ramp along the motorway")


class Viaduct(MotorwayClass):
    """A dual carriageway one layer above the streets."""

    pattern: Literal["viaduct"]
    name: str = "viaduct"
    points_m: tuple[PointXY, ...] = Field(min_length=2, description="corners of its line")
    radius_m: float = Field(120.0, ge=60, description="radius of its curves")
    closed: bool = True
    elevated_m: float = Field(7.5, gt=0, le=20)
    elevated_within_m: tuple[float, float, float, float] | None = Field(
        None, description="west, south, east, north: on pillars there, on the ground elsewhere; none: everywhere"
    )
    diamonds: tuple[Diamond, ...] = ()


def draw_viaduct(pattern: Viaduct, draft: Draft, rng: np.random.Generator) -> None:
    """Append both carriageways and their ramps; does not use ``rng``.

    Raises:
        InputError: A diamond's street does not exist.
    """
    axis_m = round_corners(np.array(pattern.points_m), pattern.radius_m, pattern.closed)
    motorway = DualCarriageway(pattern.name, pattern, axis_m)
    ramps = Draft()
    for diamond in pattern.diamonds:
        for carriageway in motorway.carriageways:
            _add_half_diamond(pattern, diamond, carriageway, draft, ramps)
    motorway.append_to(ramps)
    for road in ramps.roads:
        elevated_m = pattern.elevated_m if _is_elevated(pattern, road) else 0.0
        draft.roads.append(replace(road, layer=_LAYER, elevated_m=elevated_m))


def _is_elevated(pattern: Viaduct, road: DraftRoad) -> bool:
    return pattern.elevated_within_m is None or shapely.box(*pattern.elevated_within_m).intersects(
        shapely.LineString(road.line_m)
    )


def _add_half_diamond(pattern: Viaduct, diamond: Diamond, carriageway: Carriageway, draft: Draft, ramps: Draft) -> None:
    """Add an exit before the street and an entry after it, on the right of one carriageway."""
    line = shapely.LineString(carriageway.line_m)
    crossing_m = line.project(shapely.Point(diamond.near_m))
    point_m, along = carriageway.pose(crossing_m)
    right = np.array([along[1], -along[0]])
    beside_m = point_m + (pattern.lanes * pattern.lane_width_m + diamond.beside_m) * right
    terminal_m = _insert_terminal(draft, diamond, beside_m)
    draft.signals_m.append(terminal_m)
    name = f"{pattern.name}.{diamond.street}.{carriageway.name.rsplit('.', 1)[-1]}"
    add_exit_ramp(ramps, carriageway, crossing_m - diamond.run_m, f"{name}.exit", terminal_m, along)
    add_entry_ramp(ramps, carriageway, crossing_m + diamond.run_m, f"{name}.entry", terminal_m, along)


def _insert_terminal(draft: Draft, diamond: Diamond, beside_m: Float64Array) -> Float64Array:
    """Insert a vertex into the street at its closest point to a position, and return that (2,) vertex."""
    index_of_street = next((index for index, road in enumerate(draft.roads) if road.name == diamond.street), None)
    if index_of_street is None:
        raise InputError(f"diamonds: no road before the viaduct is called {diamond.street!r}")
    road = draft.roads[index_of_street]
    street = shapely.LineString(road.line_m)
    station_m = street.project(shapely.Point(beside_m))
    vertex_m = np.array(street.interpolate(station_m).coords[0])
    index = int(np.searchsorted(stations_m(road.line_m), station_m))
    draft.roads[index_of_street] = replace(road, line_m=np.insert(road.line_m, index, vertex_m, axis=0))
    return vertex_m
