"""What a map says about the land beside its roads: relief, water, zones, buildings."""

from dataclasses import dataclass, field

import shapely

from simbev_ros.maps.surroundings import ReliefRecipe, SurroundingsRecipe


@dataclass(frozen=True, slots=True)
class Water:
    """A river, lake or canal: plan area and height of its surface, map frame, metres."""

    area: shapely.Polygon
    surface_m: float


@dataclass(frozen=True, slots=True)
class Footprint:
    """A building that the map prescribes.

    Attributes:
        outline: In plan, map frame; with courtyards as holes.
        height_m: Above the ground.
        use: house, apartments, retail, office, public, church, industrial, barn, shed, or "" where it is not known.
        roof: Its shape as OpenStreetMap calls it (flat, gabled, hipped, ...), or "" where it is not known.
    """

    outline: shapely.Polygon
    height_m: float
    use: str = ""
    roof: str = ""


@dataclass(frozen=True, slots=True)
class Zone:
    """Land with a character of its own; where zones overlap, the last one holds."""

    area: shapely.Polygon
    surroundings: SurroundingsRecipe


@dataclass(frozen=True, slots=True)
class MapFeatures:
    """All of it.

    Attributes:
        surroundings: Character of the land outside all zones.
        zones: In ascending precedence.
        relief: Shape of the land far from roads; the road heights hold near them.
        water: Roads that cross it are bridges.
        buildings: None: they are invented; else these and no others.
    """

    surroundings: SurroundingsRecipe
    zones: tuple[Zone, ...] = ()
    relief: ReliefRecipe = field(default_factory=ReliefRecipe)
    water: tuple[Water, ...] = ()
    buildings: tuple[Footprint, ...] | None = None
