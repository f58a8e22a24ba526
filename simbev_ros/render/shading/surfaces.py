"""What the shaders know of materials: which shader shades each, and its optical properties."""

from functools import lru_cache
from importlib.resources import files

import numpy as np
import yaml

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.types import UInt8Array

SKY_CLASS = 0
_BLOCK_LENGTH = 64


@lru_cache(maxsize=1)
def shading_classes() -> tuple[str, ...]:
    """Names of the shading classes; the index in the tuple, from 1 on, is the class."""
    return ("sky", *_classes())


def shading_flag_of_material() -> UInt8Array:
    """(256,) uint8 shading class of each ``Material``, as the bit of its number."""
    result = np.ones(256, np.uint8)
    for number, names in enumerate(_classes().values(), start=1):
        result[[Material[name] for name in names]] = 1 << number
    return result


def material_block() -> bytes:
    """The uniform block ``Materials``, std140: roughness, metallic, specular per material."""
    table = load_materials()
    block = np.zeros((_BLOCK_LENGTH, 4), np.float32)
    block[: len(Material), :3] = np.stack([table.roughness, table.metallic, table.specular], axis=1)
    return block.tobytes()


@lru_cache(maxsize=1)
def _classes() -> dict[str, list[str]]:
    text = files("simbev_ros.render.shading").joinpath("shading.yaml").read_text(encoding="utf-8")
    classes: dict[str, list[str]] = yaml.safe_load(text)["classes"]
    return classes
