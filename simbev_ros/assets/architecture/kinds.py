"""The catalogue of building kinds: what each needs of its place, and the function that builds it."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml
from pydantic import Field

from simbev_ros.assets.architecture.farms import barn, shed, silo
from simbev_ros.assets.architecture.houses import villa
from simbev_ros.assets.architecture.plot import Plot
from simbev_ros.assets.architecture.public import church, lecture_block, school
from simbev_ros.assets.architecture.town import apartments, office, shop, town_house
from simbev_ros.assets.architecture.walls import Wall, draw_wall
from simbev_ros.assets.architecture.works import hall, tanks, warehouse
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.base import Model

_BUILDERS: Mapping[str, Callable[[Plot, Wall, np.random.Generator], Mesh]] = {
    "town_house": town_house,
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
    """A kind of building; explained in kinds.yaml."""

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
        """Walls of a recipe's style if they suit, otherwise of one that does."""
        if style not in self.walls:
            weights = np.array(list(self.walls.values()))
            style = list(self.walls)[int(rng.choice(len(weights), p=weights / weights.sum()))]
        return draw_wall(style, rng)


def build(kind: str, plot: Plot, wall: Wall, rng: np.random.Generator) -> Mesh:
    """A building, closed, in the frame of ``facades``."""
    return _BUILDERS[kind](plot, wall, rng)


@lru_cache(maxsize=1)
def load_kinds() -> Mapping[str, Kind]:
    """All kinds by name."""
    text = files("simbev_ros.assets.architecture").joinpath("kinds.yaml").read_text(encoding="utf-8")
    return {name: Kind(**entry) for name, entry in yaml.safe_load(text).items()}
