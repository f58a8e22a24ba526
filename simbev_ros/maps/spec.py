"""The map of a scene, as scene specifications record it."""

from pydantic import Field

from simbev_ros.config.base import Model


class MapSpec(Model):
    """Identifies a map: a built-in town by name, or a map file; created by ``source.map_spec``."""

    name: str = Field(description="the town's, or the file's without its suffix; fit for file names")
    seed: int = Field(0, ge=0, description="of all that the map leaves open, such as its surroundings")
    path: str = Field("", description="absolute path of the file; empty: a town of ours")
    sha256: str = Field("", description="of the file's content when the map was chosen")
