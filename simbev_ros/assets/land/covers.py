"""Ground covers: areas with a finish (covers.yaml) that ``roads.ground`` lays on the land."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish
from simbev_ros.assets.palette import rgb
from simbev_ros.config.weather import Season
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.tables import load_table

PATH_RISE_M, PAINT_RISE_M = 0.012, 0.02
"""Height of paths and of paint on yards above the cover below."""

BAY_LINE = Finish(Material.MARKING, Tag.GROUND, (214, 214, 208))


@dataclass(frozen=True, slots=True)
class Cover:
    """A piece of covered ground.

    Attributes:
        area: Area, map frame, meters. Covers with a rise of 0 cover all of the land without overlap.
        finish: Finish of the cover.
        rise_m: Height above the land, for covers that lie on top of others.
        yaw_rad: Direction of the first axis of ``uv``, along which crop rows run.
    """

    area: BaseGeometry
    finish: Finish
    rise_m: float = 0.0
    yaw_rad: float = 0.0


def finish_of(name: str, landscape: str, season: Season = "summer") -> Finish:
    """Finish by its name in covers.yaml, in the colors of a landscape and a season."""
    name = _tables()["in_season"].get(name, {}).get(season, name)
    entry = _tables()["finishes"][name]
    color = entry["color"]
    code = int(color[landscape] if isinstance(color, dict) else color)
    tint: Sequence[float] = _tables()["tints"].get(entry["material"], {}).get(season, (1.0, 1.0, 1.0))
    red, green, blue = (round(channel * factor) for channel, factor in zip(rgb(code), tint, strict=True))
    return Finish(Material[entry["material"]], Tag[entry["tag"]], (red, green, blue))


def draw_crop(landscape: str, rng: np.random.Generator, season: Season = "summer") -> Finish:
    """Draw the crop of a field in a landscape, as it looks in a season."""
    weights: Mapping[str, float] = _tables()["crops"][landscape]
    share = np.array(list(weights.values()), np.float64)
    return finish_of(list(weights)[int(rng.choice(len(weights), p=share / share.sum()))], landscape, season)


@lru_cache(maxsize=1)
def _tables() -> Mapping[str, Any]:
    return load_table("simbev_ros.assets.land", "covers.yaml")
