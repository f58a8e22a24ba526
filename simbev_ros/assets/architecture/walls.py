"""Wall styles of building recipes, and the material and palette of each."""

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


@dataclass(frozen=True, slots=True)
class Wall:
    """Style, material and color of a building's walls."""

    style: str
    material: Material
    color: Color


def draw_wall(style: str, rng: np.random.Generator) -> Wall:
    """Draw walls of a style in a random color of the style's palette."""
    return Wall(style, _MATERIALS[style], pick_color(rng, f"walls.{style}"))
