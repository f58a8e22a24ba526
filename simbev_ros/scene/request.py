"""What the world node is asked to play."""

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.scene.spec import SceneSpec


class SceneRequest(Model):
    """One scene, as it is asked for on /world/request."""

    spec: SceneSpec
    replay: str | None = Field(None, description="absolute path of a bag to take all motion from; none: simulate it")
