"""Body proportions that all human figures share, read from body.yaml."""

from functools import lru_cache

from simbev_ros.assets.actors.solids import Vector
from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table

Ring = tuple[float, float, float, float]
"""Horizontal ring of a body part: height, x, half depth, half width."""


class Lump(Model):
    """A piece of face, hair or headgear: finish (``skin`` and ``hair`` mean the figure's own), size and position."""

    finish: str
    size: Vector
    at: Vector


class Body(Model):
    """Body proportions, as lengths over the body height; body.yaml explains the fields."""

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
    """Load body.yaml."""
    return Body.model_validate(load_table("simbev_ros.assets.actors", "body.yaml"))
