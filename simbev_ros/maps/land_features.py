"""Data classes for the land around a map's roads: relief, water, zones and buildings, as the map prescribes them."""

from dataclasses import dataclass, field

import shapely

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
        height_m: Height above the ground.
        use: house, apartments, retail, office, public, church, industrial, barn, shed, or "" if unknown.
        roof: Roof shape in OpenStreetMap's terms (flat, gabled, hipped, ...), or "" if unknown.
    """

    outline: shapely.Polygon
    height_m: float
    use: str = ""
    roof: str = ""


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
    """

    surroundings: SurroundingsRecipe
    zones: tuple[Zone, ...] = ()
    relief: ReliefRecipe = field(default_factory=ReliefRecipe)
    water: tuple[Water, ...] = ()
    buildings: tuple[Footprint, ...] | None = None
