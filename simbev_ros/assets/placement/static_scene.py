"""The immobile part of the world: tiles of mesh, and the surfaces that are labelled but not seen."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.types import Float64Array


@dataclass(frozen=True, slots=True)
class Tile:
    """A square piece of the static world.

    Attributes:
        origin_m: (3,) float64, map frame; the mesh's vertices are relative to it.
        mesh: Everything that is seen and hit in this tile. An object lies wholly in one tile.
        surfaces: Class name ("crosswalk", "hazard") → mesh that counts in labels but is neither seen nor hit.
        level: That of the roads in it; what lies on structures has tiles of its own (``layout.Strip.level``).
        coarse: What cameras far away see instead of the last ``detail`` triangles of the mesh.
        detail: How many triangles of the mesh that are.
    """

    origin_m: Float64Array
    mesh: Mesh
    surfaces: Mapping[str, Mesh]
    level: int = 0
    coarse: Mesh = field(default_factory=Mesh.empty)
    detail: int = 0


@dataclass(frozen=True, slots=True)
class StreetLight:
    """A lamp: position of its light source in the map frame, metres."""

    position_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, weakref_slot=True)
class StaticScene:
    """Tiles and street lights of a map, or of its regions around a place; deterministic from (map, seed)."""

    tiles: tuple[Tile, ...]
    street_lights: tuple[StreetLight, ...]
