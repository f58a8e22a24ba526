"""The static world: tiles of meshes, label-only surfaces, and street lights."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.tunnels import Tunnels


@dataclass(frozen=True, slots=True)
class Tile:
    """A square piece of the static world.

    Attributes:
        origin_m: (3,) float64, map frame; the mesh's vertices are relative to it.
        mesh: Everything in the tile that cameras see and rays hit. Each object lies wholly in one tile.
        surfaces: Class name ("crosswalk", "hazard") → mesh that appears in labels only, neither seen nor hit.
        level: Level of the roads in the tile; streets on structures have separate tiles (``layout.Strip.level``).
        coarse: Mesh that distant cameras see instead of the last ``detail`` triangles of ``mesh``.
        detail: Number of triangles at the end of ``mesh`` that ``coarse`` replaces.
    """

    origin_m: Float64Array
    mesh: Mesh
    surfaces: Mapping[str, Mesh]
    level: int = 0
    coarse: Mesh = field(default_factory=Mesh.empty)
    detail: int = 0


@dataclass(frozen=True, slots=True)
class StreetLight:
    """A street lamp, given by the position of its light source in the map frame, meters."""

    position_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, weakref_slot=True)
class StaticScene:
    """Tiles, street lights and tunnels of a map, or of its regions around a point; determined by map and seed."""

    tiles: tuple[Tile, ...]
    street_lights: tuple[StreetLight, ...]
    tunnels: Tunnels = field(default_factory=Tunnels.none)
