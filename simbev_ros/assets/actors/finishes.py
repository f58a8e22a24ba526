"""The finishes that shapes name: finishes.yaml as a lookup."""

from functools import lru_cache
from importlib.resources import files

import yaml

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.semantics import Tag


@lru_cache(maxsize=1)
def _finishes() -> dict[str, tuple[Material, tuple[int, int, int]]]:
    data = yaml.safe_load(files("simbev_ros.assets.actors").joinpath("finishes.yaml").read_text())
    return {name: (Material[entry["material"]], tuple(entry["color"])) for name, entry in data.items()}


def finish_named(name: str, tag: Tag, part: int = 0) -> Finish:
    """The finish of this name in finishes.yaml, or ``cloth #RRGGBB`` and the like: a material with a colour.

    Args:
        name: Key of finishes.yaml, or a material's lower-case name and a colour.
        tag: Semantic tag of what gets the finish.
        part: Rigid part that moves it.

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
    """The name of the same thing on the other side: left becomes right."""
    return name.replace("left", "right")
