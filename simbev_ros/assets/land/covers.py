"""What covers the land: areas with a finish, to be laid on the ground."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
import yaml
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.semantics import Tag

PATH_RISE_M, PAINT_RISE_M = 0.012, 0.02
"""Paths lie so much above what they cross, and paint on yards above that."""

BAY_LINE = Finish(Material.MARKING, Tag.GROUND, (214, 214, 208))


@dataclass(frozen=True, slots=True)
class Cover:
    """A piece of ground.

    Attributes:
        area: Map frame, metres. Covers that do not rise share borders and nothing else, and cover all of the land.
        finish: Of what.
        rise_m: So much above the land: what lies on other covers.
        yaw_rad: Of the surface coordinates' first axis, along which crops grow.
    """

    area: BaseGeometry
    finish: Finish
    rise_m: float = 0.0
    yaw_rad: float = 0.0


def finish_of(name: str, landscape: str) -> Finish:
    """A finish of covers.yaml in the colours of a landscape."""
    entry = _tables()["finishes"][name]
    color = entry["color"]
    code = int(color[landscape] if isinstance(color, dict) else color)
    return Finish(Material[entry["material"]], Tag[entry["tag"]], (code >> 16, code >> 8 & 255, code & 255))


def draw_crop(landscape: str, rng: np.random.Generator) -> Finish:
    """What grows on a field of a landscape."""
    weights: Mapping[str, float] = _tables()["crops"][landscape]
    share = np.array(list(weights.values()), np.float64)
    return finish_of(list(weights)[int(rng.choice(len(weights), p=share / share.sum()))], landscape)


@lru_cache(maxsize=1)
def _tables() -> Mapping[str, Any]:
    text = files("simbev_ros.assets.land").joinpath("covers.yaml").read_text(encoding="utf-8")
    tables: Mapping[str, Any] = yaml.safe_load(text)
    return tables
