"""The request message that tells the world node which scene to play."""

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.scene.spec import SceneSpec


class SceneRequest(Model):
    """Request for one scene, as sent on /world/request."""

    spec: SceneSpec
    replay: str | None = Field(None, description="absolute path of the bag to replay; none: simulate the scene")
    number: int = Field(0, ge=0, description="one more with each request of a graph: earlier ones do not count again")
