"""Data classes for the land around a map's roads: relief, water, zones, buildings and objects that a map prescribes."""

from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np
import shapely

from simbev_ros.foundation.geometry.plan_view import points_inside
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.maps.surroundings import ReliefRecipe, SurroundingsRecipe


@dataclass(frozen=True, slots=True)
class Water:
    """A river, lake or canal: area in plan view and height of its surface, map frame, meters."""

    area: shapely.Polygon
    surface_m: float


@dataclass(frozen=True, slots=True)
class Footprint:
    """A building that the map prescribes.

    Attributes:
        outline: Footprint polygon in plan view, map frame; courtyards are holes.
        height_m: Height of its top above the ground, roof included.
        use: house, apartments, retail, office, public, church, industrial, barn, shed, or "" if unknown.
        roof: Roof shape in OpenStreetMap's terms (flat, gabled, hipped, ...), or "" if unknown.
        bottom_m: Height of its underside above the ground: 0, or more for a part of a building.
        roof_height_m: Height of the roof alone; 0: as usual for its shape.
        slope_rad: Direction in which the roof falls, across its ridge; NaN: across the longer side of the building.
        wall: Style of the walls (brick, plaster, glass, ...), or "" if unknown.
        color: Color of the walls as 0xRRGGBB sRGB; -1 if unknown.
        roof_color: Likewise of the roof.
    """

    outline: shapely.Polygon
    height_m: float
    use: str = ""
    roof: str = ""
    bottom_m: float = 0.0
    roof_height_m: float = 0.0
    slope_rad: float = np.nan
    wall: str = ""
    color: int = -1
    roof_color: int = -1


class ObjectKind(StrEnum):
    """Kind of an object beside the road."""

    TREE = "tree"
    CONIFER = "conifer"
    PALM = "palm"
    BUSH = "bush"
    STREET_LAMP = "street_lamp"
    UTILITY_POLE = "utility_pole"
    BENCH = "bench"
    BIN = "bin"
    HYDRANT = "hydrant"
    CABINET = "cabinet"
    MAILBOX = "mailbox"
    BICYCLE_RACK = "bicycle_rack"
    BUS_SHELTER = "bus_shelter"
    POLE = "pole"
    WALL = "wall"
    FENCE = "fence"
    HEDGE = "hedge"
    GUARD_RAIL = "guard_rail"
    ISLAND = "island"
    OBSTACLE = "obstacle"
    RAILS = "rails"
    PARKING_LOT = "parking_lot"
    PARKING_SPACE = "parking_space"


POINT_KINDS = frozenset(
    {
        *(ObjectKind.TREE, ObjectKind.CONIFER, ObjectKind.PALM, ObjectKind.BUSH),
        *(ObjectKind.STREET_LAMP, ObjectKind.UTILITY_POLE, ObjectKind.BENCH, ObjectKind.BIN, ObjectKind.HYDRANT),
        *(ObjectKind.CABINET, ObjectKind.MAILBOX, ObjectKind.BICYCLE_RACK, ObjectKind.BUS_SHELTER),
    }
)
"""Kinds with a model of their own, which stand at a point."""

BARRIER_KINDS = (ObjectKind.WALL, ObjectKind.FENCE, ObjectKind.HEDGE)
"""Kinds that run along a line or fill an outline."""


@dataclass(frozen=True, slots=True)
class MapObject:
    """An object that the map prescribes. Things stand at one point, barriers run along a line or fill an outline.

    Attributes:
        kind: Its kind.
        points_m: (N, 3) map frame, on the surface of the road or land below it: one point, a line, or an outline, which
            ends at its first point.
        height_m: Its height; 0: as usual for its kind.
        bottom_m: Height of its underside above the surface.
        yaw_rad: Direction that it faces; NaN: toward the nearest road.
    """

    kind: ObjectKind
    points_m: Float64Array
    height_m: float = 0.0
    bottom_m: float = 0.0
    yaw_rad: float = np.nan

    @property
    def is_outline(self) -> bool:
        """Whether its points are an outline."""
        return len(self.points_m) > 3 and np.array_equal(self.points_m[0], self.points_m[-1])


@dataclass(frozen=True, slots=True)
class SpeedBump:
    """A bump across a road: (N, 3) corners, map frame, NaN if their height is unknown, and the speed to pass it."""

    outline_m: Float64Array
    speed_mps: float


@dataclass(frozen=True, slots=True)
class Zone:
    """An area with its own surroundings; where zones overlap, the last one takes precedence."""

    area: shapely.Polygon
    surroundings: SurroundingsRecipe


@dataclass(frozen=True, slots=True)
class MapFeatures:
    """Everything that a map says about the land around its roads.

    Attributes:
        surroundings: Surroundings outside all zones.
        zones: In ascending precedence.
        relief: Hills far from the roads; near roads the land follows the road heights.
        water: Bodies of water; a road that crosses one is a bridge.
        buildings: The only buildings of the map; None if buildings are generated instead.
        objects: Objects beside the roads; near those of a kind, no others of that kind are generated.
        speed_bumps: Bumps on the roads.
    """

    surroundings: SurroundingsRecipe
    zones: tuple[Zone, ...] = ()
    relief: ReliefRecipe = field(default_factory=ReliefRecipe)
    water: tuple[Water, ...] = ()
    buildings: tuple[Footprint, ...] | None = None
    objects: tuple[MapObject, ...] = ()
    speed_bumps: tuple[SpeedBump, ...] = ()

    def uses_at(self, xy_m: Float64Array) -> AnyArray:
        """(N,) names of the land uses at (N, 2) positions, map frame."""
        uses = np.full(len(xy_m), self.surroundings.use, object)
        for zone, inside in zip(self.zones, points_inside([zone.area for zone in self.zones], xy_m), strict=True):
            uses[inside] = zone.surroundings.use
        return uses
