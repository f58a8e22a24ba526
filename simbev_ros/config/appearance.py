"""Section ``appearance``: looks beyond what is plausible, so that networks learn shapes (domain randomization)."""

from typing import Annotated

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.draw import Drawn, within


class Appearance(Model):
    """How surfaces look in color images. Lidar, radar and labels do not depend on it."""

    randomize: Annotated[Drawn, within(0, 1)] = Field(
        0.0,
        description="strength of random colors and patterns of surfaces, and of random colors of the light; "
        "0: plausible ones",
    )
