"""Of what walls are built: the styles of a recipe, and the material and color that each stands for."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.palette import Color, pick_color

_MATERIALS = {
    "brick": Material.BRICK_FACADE,
    "plaster": Material.FACADE,
    "timber": Material.TIMBER_FACADE,
    "concrete": Material.CONCRETE_FACADE,
    "metal": Material.METAL_FACADE,
    "glass": Material.OFFICE_GLASS,
}
STYLES = tuple(_MATERIALS)
"""Names of all styles but ``mixed``."""


@dataclass(frozen=True, slots=True)
class Wall:
    """A building's walls: style, material and color."""

    style: str
    material: Material
    color: Color


def draw_wall(style: str, rng: np.random.Generator) -> Wall:
    """Walls of a style in a random color of it."""
    return Wall(style, _MATERIALS[style], pick_color(rng, f"walls.{style}"))
