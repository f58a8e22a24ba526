"""Catalog of building kinds: the space that each kind needs (kinds.yaml), and the function that builds it."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np
from pydantic import Field

from simbev_ros.assets.architecture.farms import barn, shed, silo
from simbev_ros.assets.architecture.houses import villa
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.public import church, lecture_block, school
from simbev_ros.assets.architecture.town import apartments, office, shop, terrace, town_house
from simbev_ros.assets.architecture.walls import Wall, draw_wall
from simbev_ros.assets.architecture.works import hall, tanks, warehouse
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table

_BUILDERS: Mapping[str, Callable[[Plot, Wall, np.random.Generator], Mesh]] = {
    "town_house": town_house,
    "terrace": terrace,
    "apartments": apartments,
    "office": office,
    "shop": shop,
    "villa": villa,
    "hall": hall,
    "warehouse": warehouse,
    "tanks": tanks,
    "farmhouse": villa,
    "barn": barn,
    "shed": shed,
    "silo": silo,
    "lecture_block": lecture_block,
    "school": school,
    "church": church,
}


class Kind(Model):
    """Properties of a building kind; kinds.yaml explains the fields."""

    width: tuple[int, int]
    depth: tuple[int, int]
    walls: dict[str, float]
    gap_m: tuple[float, float]
    party: float = Field(ge=0, le=1)
    front_m: float
    setback_m: float
    verge_m: float
    rise_m: float
    height_m: tuple[float, float] | None = None

    def draw_wall(self, style: str, rng: np.random.Generator) -> Wall:
        """Draw walls of a recipe's style if the kind supports it, otherwise of one of the kind's own styles."""
        if style not in self.walls:
            weights = np.array(list(self.walls.values()))
            style = list(self.walls)[int(rng.choice(len(weights), p=weights / weights.sum()))]
        return draw_wall(style, rng)


def build(kind: str, plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """Build the closed mesh of a building of a kind, in the frame of ``facades``."""
    return _BUILDERS[kind](plot, wall, rng)


@lru_cache(maxsize=1)
def load_kinds() -> Mapping[str, Kind]:
    """Load kinds.yaml: all building kinds by name."""
    return {name: Kind(**entry) for name, entry in load_table("simbev_ros.assets.architecture", "kinds.yaml").items()}
