"""Messages from the supervisor to the world node: the scene to play, and requests to end it early."""

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.schema.scene.spec import SceneSpec


class SceneRequest(Model):
    """Request for one scene, as sent on /world/request."""

    spec: SceneSpec
    replay: str | None = Field(None, description="absolute path of the bag to replay; none: simulate the scene")
    config: str | None = Field(None, description="configuration as YAML, for the bag; none: the recorder's parameter")
    paused: bool = Field(False, exclude_if=lambda value: not value, description="the world waits before the first tick")
    number: int = Field(0, ge=0, description="one more with each request of a graph: earlier ones do not count again")


class SceneStop(Model):
    """Request to end a scene with its next tick, or to go on without a participant, as sent on /world/stop."""

    number: int = Field(ge=0, description="number of the request for the scene")
    reason: str = Field(description="why the scene ends, in words")
    without: str | None = Field(None, description="participant that is not waited for again; none: the scene ends")
