"""The map of a scene, as scene specifications record it."""

import re

from pydantic import Field

from simbev_ros.config.base import Model
from simbev_ros.config.map_files import MAP_SUFFIXES, Bounds
from simbev_ros.config.names import Name
from simbev_ros.config.weather import Season

_PATH = f"(?is)^(/[^\\x00]*({'|'.join(map(re.escape, MAP_SUFFIXES))}))?$"


class MapSpec(Model):
    """Identifies a map: a built-in town by name, or a map file; created by ``source.map_spec``."""

    name: Name = Field(description="name of the town, or of the file without its suffix")
    seed: int = Field(
        0, ge=0, description="random seed for everything that the map does not prescribe, such as its surroundings"
    )
    path: str = Field(
        "", pattern=_PATH, max_length=4096, description="absolute path of the file; empty for a built-in town"
    )
    sha256: str = Field(
        "", pattern="^([0-9a-f]{64})?$", description="SHA-256 of the file's content when the map was chosen"
    )
    bounds: Bounds | None = Field(
        None, description="part of an OpenStreetMap file: west, south, east, north in degrees; none: all of it"
    )
    season: Season = Field("summer", description="season of plants and ground; roads do not depend on it")
