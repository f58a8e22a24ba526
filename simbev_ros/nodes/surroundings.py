"""Loads the static scene around the ego for the nodes that render it, cast rays into it or annotate it."""

from collections.abc import Iterable
from weakref import WeakValueDictionary

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.maps.spec import MapSpec
from simbev_ros.scene.reach import VIEW_M, loaded_reach
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.mount import vector
from simbev_ros.types import Float64Array

_MAX_MOUNT_M = 30.0
"""Upper bound of a sensor's distance from the ego's origin."""

_LOOKAHEAD_S = 1.0

_Key = tuple[MapSpec, Reach | None]

_loaded: WeakValueDictionary[_Key, StaticScene] = WeakValueDictionary()
"""Scenes shared by the nodes of a process, as long as one of them holds the scene."""


class Surroundings:
    """Tracks which static scene a node has loaded, so that scenes of one region load it once."""

    def __init__(self) -> None:
        self._key: _Key | None = None

    def load_if_changed(self, spec: SceneSpec, view_m: float = VIEW_M) -> StaticScene | None:
        """Load the static scene that a scene needs; return None if the node's current one still suffices.

        Args:
            spec: The scene.
            view_m: Distance from the ego up to which the node needs the static scene.
        """
        network = load_network(spec.map)
        key = spec.map, loaded_reach(spec, network, view_m)
        if key == self._key:
            return None
        static = _loaded.get(key)
        if static is None:
            static = _loaded[key] = load_static_scene(spec.map, network, reach=key[1])
        self._key = key
        return static


def ray_view_radius_m(ranges_m: Iterable[float]) -> float:
    """View distance of a node whose sensors have these ranges; lidars and radars of equal range share one scene."""
    return max(ranges_m, default=0.0) + _MAX_MOUNT_M


def predicted_position_m(state: WorldState) -> Float64Array:
    """(3,) position of the ego ``_LOOKAHEAD_S`` later, map frame, for which ray casting can prepare ahead of time."""
    position_m: Float64Array = vector(state.ego, "x y z") + _LOOKAHEAD_S * vector(state.ego, "vx vy vz")
    return position_m
