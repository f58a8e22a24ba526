"""The map of a scene, as scene specifications record it."""

from pydantic import Field

from simbev_ros.config.base import Model


class MapSpec(Model):
    """Identifies a map: a built-in town by name, or a map file; created by ``source.map_spec``."""

    name: str = Field(description="name of the town, or of the file without its suffix; safe for file names")
    seed: int = Field(
        0, ge=0, description="random seed for everything that the map does not prescribe, such as its surroundings"
    )
    path: str = Field("", description="absolute path of the file; empty for a built-in town")
    sha256: str = Field("", description="SHA-256 of the file's content when the map was chosen")
