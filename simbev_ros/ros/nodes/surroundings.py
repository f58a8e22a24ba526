"""Loads the static scene around the agents for the nodes that render it, cast rays into it or annotate it."""

from collections.abc import Callable, Iterable
from typing import Generic, TypeVar
from weakref import WeakValueDictionary

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.maps.build import load_network
from simbev_ros.maps.region import Reach, Reaches
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.scene.reach import VIEW_M, loaded_reach
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.spec import SceneSpec

_MAX_MOUNT_M = 30.0
"""Upper bound of a sensor's horizontal distance from its agent's origin, however high its mast is."""

_Built = TypeVar("_Built")
_Key = tuple[MapSpec, Reach | Reaches | None]

_loaded: WeakValueDictionary[_Key, StaticScene] = WeakValueDictionary()
"""Scenes shared by the nodes of a process, as long as one of them holds the scene."""


class Surroundings(Generic[_Built]):
    """Builds what a node needs from the static scene around a scene's agents, once for all scenes of one region.

    Args:
        build: Makes, for instance, a renderer from a static scene.
        release: Frees the resources of what was built.

    Attributes:
        tunnels: The tunnels of the current map.
    """

    def __init__(
        self, build: Callable[[StaticScene], _Built], release: Callable[[_Built], None] = lambda _: None
    ) -> None:
        self._build, self._release = build, release
        self._key: _Key | None = None
        self.tunnels = Tunnels.none()
        self._built: _Built | None = None

    def load(self, spec: SceneSpec, view_m: float = VIEW_M) -> _Built:
        """Load the static scene that a scene needs and build from it, unless the current one suffices.

        Args:
            spec: The scene.
            view_m: Distance from each agent up to which the node needs the static scene.
        """
        network = load_network(spec.map)
        key = spec.map, loaded_reach(spec, network, view_m)
        if key != self._key:
            static = _loaded.get(key)
            if static is None:
                static = _loaded[key] = load_static_scene(spec.map, network, reach=key[1])
            self.close()
            self._built, self._key, self.tunnels = self._build(static), key, static.tunnels
        return self.built

    @property
    def built(self) -> _Built:
        """The object built for the current scene."""
        assert self._built is not None, "no scene has been loaded"
        return self._built

    def close(self) -> None:
        """Release what was built; further calls do nothing."""
        if self._built is not None:
            self._release(self._built)
        self._built = self._key = None


def ray_view_radius_m(ranges_m: Iterable[float]) -> float:
    """View distance of a node with sensors of these ranges; lidars and radars of equal range share one scene."""
    return max(ranges_m, default=0.0) + _MAX_MOUNT_M
