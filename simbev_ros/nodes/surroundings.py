"""The static scene around the ego, for the nodes that see it."""

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

_BESIDE_EGO_M = 30.0
"""Sensors are mounted less far from the ego's origin."""

_SOON_S = 1.0

_Key = tuple[MapSpec, Reach | None]

_loaded: WeakValueDictionary[_Key, StaticScene] = WeakValueDictionary()
"""Shared by the nodes of a process, as long as one of them holds it."""


class Surroundings:
    """Knows what its node has loaded."""

    def __init__(self) -> None:
        self._key: _Key | None = None

    def changed(self, spec: SceneSpec, view_m: float = VIEW_M) -> StaticScene | None:
        """The static scene that a scene needs; None: that of the scene before still does.

        Args:
            spec: The scene.
            view_m: How far the node looks from where the ego is.
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


def view_of_rays_m(ranges_m: Iterable[float]) -> float:
    """How far from the ego a node looks whose sensors have such ranges: the same for lidars and radars of one range."""
    return max(ranges_m, default=0.0) + _BESIDE_EGO_M


def place_soon_m(state: WorldState) -> Float64Array:
    """(3,) where the ego will be a second later, map frame: what rays need there is got ready ahead of time."""
    place_m: Float64Array = vector(state.ego, "x y z") + _SOON_S * vector(state.ego, "vx vy vz")
    return place_m
