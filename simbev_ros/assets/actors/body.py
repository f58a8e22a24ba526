"""The proportions that all figures share: body.yaml."""

from functools import lru_cache
from importlib.resources import files

import yaml

from simbev_ros.assets.actors.solids import Vector
from simbev_ros.config.base import Model

Ring = tuple[float, float, float, float]
"""Height, x, half depth, half width."""


class Lump(Model):
    """A piece of face, hair or headgear: its finish, or ``skin`` or ``hair`` for the figure's own; size and place."""

    finish: str
    size: Vector
    at: Vector


class Body(Model):
    """Proportions; lengths over the body's height. The fields are explained in body.yaml."""

    hips: tuple[Ring, ...]
    waist: tuple[Ring, ...]
    chest: tuple[Ring, ...]
    head: tuple[Ring, ...]
    shoe: tuple[Ring, ...]
    hand: Vector
    thumb: Vector
    neck: tuple[float, ...]
    thigh: tuple[float, ...]
    shin: tuple[float, ...]
    upper_arm: tuple[float, ...]
    forearm: tuple[float, ...]
    face: tuple[Lump, ...]
    hairstyles: dict[str, tuple[Lump, ...]]


@lru_cache(maxsize=1)
def load_body() -> Body:
    """The proportions."""
    text = files("simbev_ros.assets.actors").joinpath("body.yaml").read_text()
    return Body.model_validate(yaml.safe_load(text))
