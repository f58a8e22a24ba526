"""The region pattern of a town recipe: a city with suburbs, industry, villages, fields, motorways, a river and lakes.

Everything is planned on a lattice of straight lines and then warped; motorways get their interchanges after the warp.
"""

from typing import Literal

import numpy as np
import shapely
from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.foundation.geometry import overlay
from simbev_ros.maps.land_features import Zone
from simbev_ros.maps.plan.curves import bezier_between, heading_at, resample, round_corners
from simbev_ros.maps.plan.draft import Draft, DraftRoad, RoadClass
from simbev_ros.maps.plan.land import settled_area
from simbev_ros.maps.plan.lines import length_m
from simbev_ros.maps.plan.patterns.districts import Cell, DistrictsRecipe, draw_districts
from simbev_ros.maps.plan.patterns.main_roads import add_main_roads
from simbev_ros.maps.plan.patterns.motorway import DualCarriageway, LaneChange, MotorwayClass
from simbev_ros.maps.plan.patterns.region_ground import Ground, draw_ground, draw_lake, draw_river
from simbev_ros.maps.plan.patterns.street_lattice import FILL, FINE, Lattice, Point, fill_village
from simbev_ros.maps.plan.road_class import NamedRoadClass
from simbev_ros.maps.surroundings import SurroundingsRecipe

_MOTORWAY_CLEARANCE_M = 190.0
_WATER_CLEARANCE_M = 45.0
_VILLAGE_RADIUS_M = 330.0
_RADIUS_M = {"downtown": 20.0, "residential": 30.0, "country": 350.0}
_OTHER_RADIUS_M = 60.0
_NARROWED_M = 350.0  # length of an open motorway's ends that have only as many lanes as the road that continues it
_TRUNK_STEPS = 3  # lattice steps from the end of an open motorway to the region's outermost roads


class RegionZones(Model):
    """Surroundings for each kind of district."""

    downtown: SurroundingsRecipe
    residential: SurroundingsRecipe
    suburb: SurroundingsRecipe
    industrial: SurroundingsRecipe
    park: SurroundingsRecipe
    woods: SurroundingsRecipe
    farmland: SurroundingsRecipe
    village: SurroundingsRecipe


class RegionRoads(Model):
    """Cross-sections of a region's roads; streets are named by their district."""

    avenue: NamedRoadClass = Field(description="main roads of downtown")
    arterial: NamedRoadClass = Field(description="main roads around it")
    collector: NamedRoadClass = Field(description="main roads of suburbs, and into them")
    country: NamedRoadClass = Field(description="main roads elsewhere")
    downtown: NamedRoadClass
    residential: NamedRoadClass
    suburb: NamedRoadClass
    industrial: NamedRoadClass
    village: NamedRoadClass
    track: NamedRoadClass = Field(description="to farmsteads")


class Region(Model):
    """A square region around the map's origin."""

    pattern: Literal["region"]
    size_m: float = Field(10_000.0, ge=4000, le=20_000)
    cells: int = Field(10, ge=6, le=16, description="number of cells between main roads, along a side")
    districts: DistrictsRecipe = DistrictsRecipe()
    villages: int = Field(6, ge=0)
    motorway: MotorwayClass
    motorway_radius_m: float = Field(550.0, ge=100, description="radius of its curves")
    motorway_course: Literal["ring", "through"] = "ring"
    bend_m: float = Field(110.0, ge=0, le=400, description="maximum deviation of main roads from straight lines")
    rural_gaps: float = Field(0.35, ge=0, le=0.6, description="fraction of country roads that are left out")
    river_width_m: float = Field(45.0, ge=0, le=200, description="0: no river")
    lakes: int = Field(3, ge=0)
    roads: RegionRoads
    zones: RegionZones


def draw_region(pattern: Region, draft: Draft, rng: np.random.Generator) -> None:
    """Append a region: roads, zones and water."""
    ground = draw_ground(pattern.size_m, pattern.cells, pattern.bend_m, rng)
    middle = pattern.cells / 2.0 + rng.uniform(-0.6, 0.6, 2)
    districts = draw_districts(pattern.districts, pattern.cells, (float(middle[0]), float(middle[1])), rng)
    course = _motorway_course(pattern, rng)
    motorway = _motorway(pattern, ground, course)
    lattice = Lattice(pattern.cells)
    nodes = add_main_roads(lattice, districts, course, pattern.rural_gaps, rng)
    for cell, use in districts.items():
        if use in FILL:
            FILL[use](lattice, cell, rng)
    villages = _add_villages(pattern, lattice, districts, nodes, rng)
    if pattern.river_width_m > 0.0:
        draft.water.append(draw_river(ground, pattern.river_width_m, rng))
    shores = [cell for cell, use in sorted(districts.items()) if use in ("park", "woods")]
    for index in sorted(rng.permutation(len(shores))[: pattern.lakes].tolist()):
        draft.water.append(draw_lake(ground, shores[index], rng))
    _remove_blocked_streets(lattice, ground, motorway, draft.water)
    _append_roads(pattern, lattice, ground, motorway, draft, rng)
    if len(course) == 2:
        _append_trunk_roads(pattern, ground, course, motorway, draft)
    draft.zones.extend(_zones(pattern, ground, districts, villages))


def _motorway_course(pattern: Region, rng: np.random.Generator) -> tuple[Point, ...]:
    """Draw the corners of the motorway's line, in cells: a rectangle around the city, or a line past it."""
    low, high = pattern.cells // 2 - 3, pattern.cells // 2 + 3
    if pattern.motorway_course == "ring":
        return ((low, low), (high, low), (high, high), (low, high))
    column = pattern.cells // 2 + int(rng.choice([-2, 2]))
    return ((column, 0), (column, pattern.cells))


def _motorway(pattern: Region, ground: Ground, course: tuple[Point, ...]) -> DualCarriageway:
    corners = np.array(course, dtype=np.float64) * FINE
    closed = len(course) > 2
    if not closed:
        corners[:, 1] += [_TRUNK_STEPS, -_TRUNK_STEPS]
    straight_m = round_corners(ground.before_warp(corners), pattern.motorway_radius_m, closed)
    axis_m = ground.sweep(resample(straight_m, 10.0))
    whole_m = length_m(axis_m)
    narrow_stretches = ((0.0, _NARROWED_M), (whole_m - _NARROWED_M, whole_m))
    changes = tuple(
        LaneChange(start_m=start, end_m=end, lanes=_trunk_lanes(pattern)) for start, end in narrow_stretches
    )
    return DualCarriageway("motorway", pattern.motorway, axis_m, () if closed else changes)


def _trunk_lanes(pattern: Region) -> int:
    return min(pattern.motorway.lanes, 2)


def _append_trunk_roads(
    pattern: Region, ground: Ground, course: tuple[Point, ...], motorway: DualCarriageway, draft: Draft
) -> None:
    """Append two-way roads that connect the ends of an open motorway with the region's outermost roads."""
    width_m = pattern.motorway.lane_width_m
    kind = RoadClass(lanes=_trunk_lanes(pattern), lane_width_m=width_m, speed_kmh=80.0, shoulder_m=2.0, priority=8)
    ends_m = ground.bend(ground.before_warp(np.array(course) * FINE))
    for number, (axis_m, end_m) in enumerate(zip((motorway.axis_m[::-1], motorway.axis_m), ends_m, strict=True)):
        ahead = heading_at(axis_m, length_m(axis_m))
        toward = heading_at(np.array([axis_m[-1], end_m]), 0.0)
        draft.roads.append(DraftRoad(f"trunk{number}", kind, bezier_between(axis_m[-1], ahead, end_m, toward)))


def _add_villages(
    pattern: Region, lattice: Lattice, districts: dict[Cell, str], nodes: list[Point], rng: np.random.Generator
) -> list[Point]:
    """Add villages at crossings of country roads surrounded by farmland or woods; returns their lattice points."""
    rural = [
        (i, j)
        for i, j in nodes
        if all(districts.get((i + a, j + b)) in ("farmland", "woods") for a in (-1, 0) for b in (-1, 0))
    ]
    chosen = [rural[index] for index in sorted(rng.permutation(len(rural))[: pattern.villages].tolist())]
    points = [(i * FINE, j * FINE) for i, j in chosen]
    for point in points:
        fill_village(lattice, point, rng)
    return points


def _remove_blocked_streets(
    lattice: Lattice, ground: Ground, motorway: DualCarriageway, water: list[shapely.Polygon]
) -> None:
    """Remove streets that are too close to a motorway or to water; main roads may cross both."""
    keep_clear = overlay.union_all(
        [
            shapely.LineString(motorway.axis_m).buffer(_MOTORWAY_CLEARANCE_M),
            *(area.buffer(_WATER_CLEARANCE_M) for area in water),
        ]
    )
    steps = [step for step in lattice.steps if not _is_main(step)]
    ends = [ground.bend(ground.before_warp(np.array(step))) for step in steps]
    blocked = shapely.intersects(keep_clear, shapely.linestrings(np.array(ends)))
    for step, is_blocked in zip(steps, np.atleast_1d(blocked), strict=True):
        if is_blocked:
            lattice.remove_step(*step)
    lattice.prune("downtown", "residential", "industrial")
    lattice.keep_largest_part()


def _is_main(step: tuple[Point, Point]) -> bool:
    """Whether a step lies on a cell's border, where main roads run."""
    (i, j), (k, m) = step
    return (i == k and i % FINE == 0) or (j == m and j % FINE == 0)


def _append_roads(
    pattern: Region,
    lattice: Lattice,
    ground: Ground,
    motorway: DualCarriageway,
    draft: Draft,
    rng: np.random.Generator,
) -> None:
    """Append all streets, those that cross the motorway with bridges and ramps, and the motorway itself."""
    axis = shapely.LineString(motorway.axis_m)
    crossings = 0
    for number, (kind, chain) in enumerate(lattice.chains()):
        points = lattice.corners_of(chain)
        line_m = ground.line(points, _RADIUS_M.get(kind, _OTHER_RADIUS_M))
        road: RoadClass = getattr(pattern.roads, kind)
        name = f"{kind}{number}"
        if axis.crosses(shapely.LineString(line_m)):
            motorway.add_crossing_road(
                draft, name, road, line_m, over=bool(rng.random() < 0.6), ramps=crossings % 2 == 0
            )
            crossings += 1
        else:
            draft.roads.append(DraftRoad(name, road, line_m))
    motorway.append_to(draft)


def _zones(pattern: Region, ground: Ground, districts: dict[Cell, str], villages: list[Point]) -> list[Zone]:
    """One zone per connected area of one use, then the villages."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    zones = []
    for use in dict.fromkeys(districts.values()):
        cells = [ground.area((np.array(cell) + square) * FINE) for cell, other in districts.items() if other == use]
        parts = shapely.get_parts(overlay.union_all(cells, grid_size=0.01))
        zones += [Zone(part, getattr(pattern.zones, use)) for part in parts]
    centers = ground.bend(ground.before_warp(np.array(villages).reshape(-1, 2))).tolist()
    return zones + [Zone(settled_area(x_m, y_m, _VILLAGE_RADIUS_M), pattern.zones.village) for x_m, y_m in centers]
