"""Working state while a region is laid out: occupied footprints, placed objects, ground covers."""

from dataclasses import dataclass, field

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.land.covers import Cover, finish_of
from simbev_ros.assets.land.plazas import Pavement
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.placement.claims import Claims
from simbev_ros.assets.placement.ensemble import Base, Ensemble
from simbev_ros.assets.placement.nearby_objects import NearbyObjects
from simbev_ros.assets.placement.region_ground import RegionGround
from simbev_ros.assets.placement.tiles import TileBuilder
from simbev_ros.foundation.geometry import overlay
from simbev_ros.foundation.types import Float64Array

SIGNAL_CLEARANCE_M = 2.0
"""Minimum distance between crowns and signal heads."""

BORDER_M = 0.3
"""Minimum distance of objects from a region's border, so that objects of neighboring regions cannot overlap."""

ENTRANCE_M = 8.0
"""Length of the area in front of a drive or gate that parked vehicles leave free, from the street's edge inwards."""

_SIGNALS_M = 20.0


@dataclass(frozen=True, slots=True)
class Bay:
    """Room for one parked vehicle off the street.

    Attributes:
        center_m: (2,) center, map frame.
        yaw_rad: Heading of a vehicle that has driven in forward.
        length_m: Room along the heading.
        width_m: Room across it.
        is_drive: Whether it is the drive of a house.
    """

    center_m: Float64Array
    yaw_rad: float
    length_m: float
    width_m: float
    is_drive: bool = False


@dataclass(slots=True)
class Yard:
    """A region while it is laid out; layout functions put objects, claim footprints and cover land through it.

    Attributes:
        ground: Ground of the region.
        tiles: Receives single meshes.
        claims: Occupied footprints.
        ensemble: Receives repeated objects.
        covers: Ground covers so far.
        pavements: Plazas.
        fast: Area of motorways, with the land beside them that is kept open.
        lamp_posts: (2,) positions of street lights on the ground, and what they stand on.
        bays: Where vehicles park off the streets.
        entrances: Areas in front of drives and gates, the street included, where nobody parks.
        rests: (K, 5) spots for people at buildings as in ``rests_at_things``, and the (N, 4, 4) poses of their frame.
        walls: Footprints of buildings, which crowns keep clear of.
        inside: The region without a margin along its border.
        signals: Search tree of the signal heads in and near the region.
        edges: Search tree of the edge segments of streets and decks in the region.
        map_objects: Objects that the map prescribes in and near the region.
    """

    ground: RegionGround
    tiles: TileBuilder
    claims: Claims
    fast: BaseGeometry
    ensemble: Ensemble = field(default_factory=Ensemble)
    covers: list[Cover] = field(default_factory=list)
    pavements: list[Pavement] = field(default_factory=list)
    lamp_posts: list[tuple[Float64Array, Base]] = field(default_factory=list)
    bays: list[Bay] = field(default_factory=list)
    entrances: list[BaseGeometry] = field(default_factory=list)
    rests: list[tuple[Float64Array, Float64Array]] = field(default_factory=list)
    walls: list[BaseGeometry] = field(default_factory=list)
    inside: shapely.Polygon = field(init=False)
    signals: shapely.STRtree = field(init=False)
    edges: shapely.STRtree = field(init=False)
    map_objects: NearbyObjects = field(init=False)
    _near_streets: dict[float, BaseGeometry] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Compute ``inside`` and the search trees."""
        ground = self.ground
        self.inside = shapely.box(*(np.array(ground.region.area.bounds) + BORDER_M * np.array([1, 1, -1, -1])))
        signals_m = np.array([signal.position_m[:2] for signal in ground.network.signals]).reshape(-1, 2)
        signals = np.array(shapely.points(signals_m)).reshape(-1)
        self.signals = shapely.STRtree(signals[shapely.dwithin(self.inside, signals, _SIGNALS_M)])
        rims = [ground.streets[0].area.boundary, *(deck.boundary for deck in ground.decks if not deck.is_empty)]
        self.edges = shapely.STRtree(_segments(overlay.intersection(overlay.union_all(rims), self.inside)))
        self.map_objects = NearbyObjects(ground.network.features.objects, ground.region.area)

    def near_streets(self, distance_m: float) -> BaseGeometry:
        """Area of the region's streets on the ground, buffered by a distance; cached."""
        if distance_m not in self._near_streets:
            square = shapely.buffer(self.ground.region.area, distance_m, join_style="mitre")
            street = overlay.intersection(self.ground.streets[0].area, square)
            self._near_streets[distance_m] = shapely.buffer(street, distance_m, quad_segs=4)
        return self._near_streets[distance_m]

    def crown_obstacles(self) -> tuple[tuple[shapely.STRtree, float], ...]:
        """Search trees of what crowns keep clear of (buildings, signals, street edges), each with a distance in meters.

        Call this only after all buildings of the land in question have been placed.
        """
        return (shapely.STRtree(self.walls), 0.0), (self.signals, SIGNAL_CLEARANCE_M), (self.edges, 0.0)

    def cover(self, area: BaseGeometry, finish: Finish | str, landscape: str = "temperate", **options: float) -> None:
        """Cover an area with a finish, given directly or by its name in covers.yaml."""
        if not area.is_empty:
            self.covers.append(
                Cover(
                    area,
                    finish_of(finish, landscape, self.ground.season) if isinstance(finish, str) else finish,
                    **options,
                )
            )

    def claim(self, footprint: shapely.Polygon, land: BaseGeometry) -> bool:
        """Claim a footprint if it is free and lies on a piece of land within the region; return whether it did."""
        return bool(self.inside.contains(footprint) and land.contains(footprint) and self.claims.claim(footprint))


def quad(
    origin: Float64Array, along: Float64Array, x_m: tuple[float, float], y_m: tuple[float, float]
) -> shapely.Polygon:
    """Rectangle from ranges of x and y in a frame with a (2,) origin and the (2,) unit direction of its x axis."""
    return quads(origin[None], along[None], x_m, y_m)[0]


def quads(
    origins: Float64Array, along: Float64Array, x_m: tuple[float, float], y_m: tuple[float, float]
) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """(N,) equal rectangles, each in its own frame as in ``quad``."""
    x, y = np.array([[x_m[0], x_m[1], x_m[1], x_m[0]], [y_m[0], y_m[0], y_m[1], y_m[1]]])[:, None]
    corners_m = np.empty((len(origins), 4, 2))
    corners_m[..., 0] = origins[:, :1] + x * along[:, :1] - y * along[:, 1:]
    corners_m[..., 1] = origins[:, 1:] + x * along[:, 1:] + y * along[:, :1]
    return np.asarray(shapely.polygons(corners_m), object)


def yaw_of(direction: Float64Array) -> float:
    """Heading of a (2,) vector in radians."""
    return float(np.arctan2(direction[1], direction[0]))


def _segments(lines: BaseGeometry) -> np.ndarray[tuple[int], np.dtype[np.object_]]:
    """Straight segments of lines."""
    parts = shapely.get_parts(lines)
    xy_m, part = shapely.get_coordinates(parts, return_index=True)
    onward = part[1:] == part[:-1]
    return np.atleast_1d(shapely.linestrings(np.stack([xy_m[:-1], xy_m[1:]], axis=1)[onward]))
