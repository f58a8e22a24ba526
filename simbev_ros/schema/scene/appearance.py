"""How the surfaces of a scene look in color images."""

from pydantic import Field

from simbev_ros.config.base import Model


class AppearanceSpec(Model):
    """Random colors and patterns of a scene; the default has none."""

    seed: int = Field(0, ge=0, description="determines the colors and patterns")
    randomize: float = Field(0.0, ge=0, le=1, description="strength of random colors and patterns")
