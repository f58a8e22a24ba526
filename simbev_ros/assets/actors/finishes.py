"""Looks up the finishes that shapes refer to by name, in finishes.yaml."""

from functools import lru_cache

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table


@lru_cache(maxsize=1)
def _finishes() -> dict[str, tuple[Material, tuple[int, int, int]]]:
    data = load_table("simbev_ros.assets.actors", "finishes.yaml")
    return {name: (Material[entry["material"]], tuple(entry["color"])) for name, entry in data.items()}


def finish_named(name: str, tag: Tag, part: int = 0) -> Finish:
    """Finish by its name in finishes.yaml, or by material and color, such as ``cloth #RRGGBB``.

    Args:
        name: Key of finishes.yaml, or a material's lower-case name and a color.
        tag: Semantic tag of the surface.
        part: Rigid part that moves the surface.

    Raises:
        KeyError: There is no such finish.
    """
    material_name, _, color = name.partition(" #")
    if color:
        return Finish(Material[material_name.upper()], tag, _rgb(color), part)
    material, rgb = _finishes()[name]
    return Finish(material, tag, rgb, part)


def _rgb(hexadecimal: str) -> tuple[int, int, int]:
    """RRGGBB as three numbers 0..255."""
    value = int(hexadecimal, 16)
    return value >> 16, value >> 8 & 255, value & 255


def mirrored_name(name: str) -> str:
    """Name of the mirrored counterpart: ``left`` becomes ``right``."""
    return name.replace("left", "right")
