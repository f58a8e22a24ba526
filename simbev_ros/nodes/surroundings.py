"""The static scene of the map that the nodes of one process are on, kept while scenes stay on it."""

from functools import lru_cache

from simbev_ros.assets.static_cache import load_static_scene
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.maps.build import load_network
from simbev_ros.maps.spec import MapSpec


@lru_cache(maxsize=1)
def surroundings(spec: MapSpec) -> StaticScene:
    """The static scene of a map, from the cache on disk where it is there."""
    return load_static_scene(spec, load_network(spec))
