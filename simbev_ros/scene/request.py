"""The request message that tells the world node which scene to play."""

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.scene.spec import SceneSpec


class SceneRequest(Model):
    """Request for one scene, as sent on /world/request."""

    spec: SceneSpec
    replay: str | None = Field(None, description="absolute path of the bag to replay; none: simulate the scene")
