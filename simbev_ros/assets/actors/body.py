"""Body proportions that all human figures share, read from body.yaml."""

from functools import lru_cache

from simbev_ros.assets.actors.solids import AnySolid, Vector
from simbev_ros.config.base import Model
from simbev_ros.foundation.tables import load_table

Ring = tuple[float, float, float, float]
"""Horizontal ring of a body part: height, x, half depth, half width."""


class ArmPose(Model):
    """An arm that does not swing: the left wrist relative to the shoulder, and the direction of the elbow."""

    wrist: Vector
    elbow: Vector


class Body(Model):
    """Body proportions, as lengths over the body height; body.yaml explains the fields."""

    hips: tuple[Ring, ...]
    waist: tuple[Ring, ...]
    chest: tuple[Ring, ...]
    head: tuple[Ring, ...]
    shoe: tuple[Ring, ...]
    palm: Vector
    fingers: Vector
    thumb: Vector
    neck: tuple[float, ...]
    thigh: tuple[float, ...]
    shin: tuple[float, ...]
    upper_arm: tuple[float, ...]
    forearm: tuple[float, ...]
    face: tuple[AnySolid, ...]
    hairstyles: dict[str, tuple[AnySolid, ...]]
    beards: dict[str, tuple[AnySolid, ...]]
    glasses: dict[str, tuple[AnySolid, ...]]
    arms: dict[str, ArmPose]


@lru_cache(maxsize=1)
def load_body() -> Body:
    """Load body.yaml."""
    return Body.model_validate(load_table("simbev_ros.assets.actors", "body.yaml"))
