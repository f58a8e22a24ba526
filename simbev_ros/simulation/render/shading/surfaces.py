"""Material properties for the shaders: shading class and optical properties of each material."""

from functools import lru_cache

import numpy as np

from simbev_ros.assets.materials import Material, load_materials
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import UInt8Array

_BLOCK_LENGTH = 64


@lru_cache(maxsize=1)
def shading_classes() -> tuple[str, ...]:
    """Names of the shading classes; the index in the tuple is the class, 0 is the sky."""
    return ("sky", *_classes())


def shading_flag_of_material() -> UInt8Array:
    """(256,) uint8 shading class k of each ``Material``, as the flag 1 << k."""
    result = np.ones(256, np.uint8)
    for number, names in enumerate(_classes().values(), start=1):
        result[[Material[name] for name in names]] = 1 << number
    return result


def material_block() -> bytes:
    """Data of the uniform block ``Materials``, std140: roughness, metallic, specular per material."""
    table = load_materials()
    block = np.zeros((_BLOCK_LENGTH, 4), np.float32)
    block[: len(Material), :3] = np.stack([table.roughness, table.metallic, table.specular], axis=1)
    return block.tobytes()


@lru_cache(maxsize=1)
def _classes() -> dict[str, list[str]]:
    return load_table("simbev_ros.simulation.render.shading", "shading.yaml")["classes"]
