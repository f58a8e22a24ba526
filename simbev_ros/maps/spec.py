"""Which map a scene takes place on."""

from pydantic import Field

from simbev_ros.config.base import Model


class MapSpec(Model):
    """A map's name, and the seed of all that its recipe leaves open: block sizes, missing streets, surroundings."""

    name: str
    seed: int = Field(0, ge=0)
