"""The static scene around the ego, for the nodes that see it."""

from weakref import WeakValueDictionary

from simbev_ros.assets.static_cache import load_static_scene
from simbev_ros.assets.static_scene import StaticScene
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach
from simbev_ros.maps.spec import MapSpec
from simbev_ros.scene.reach import VIEW_M, loaded_reach
from simbev_ros.scene.spec import SceneSpec

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
