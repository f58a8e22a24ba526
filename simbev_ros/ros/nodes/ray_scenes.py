"""The ray casting scenes of a node: one for each agent, or more, of one world that exists once."""

import math

from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.ros.nodes.surroundings import Surroundings, ray_view_radius_m
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.part_stack import load_part_stack
from simbev_ros.simulation.raycast.scene import RayScene
from simbev_ros.simulation.sensors.mount import vector

_LOOKAHEAD_S = 1.0


class RayScenes:
    """Ray casting scenes that share the static world and the models, and have poses of the actors of their own.

    Args:
        kind: The sensors that cast the rays.

    Attributes:
        reach_m: Maximum distance of a hit from the origin of the agent that carries the sensor. It is that of all
            agents of a scene, whichever of them the node serves: agents side by side then share static triangles, and
            what rays hit does not depend on how nodes share the agents.
    """

    def __init__(self, kind: type[Lidar] | type[Radar]) -> None:
        self._kind = kind
        self._surroundings = Surroundings(lambda static: [RayScene(static, load_part_stack())])
        self.reach_m = 0.0

    def load(self, spec: SceneSpec) -> None:
        """Load the meshes around the agents of a scene; they are kept while scenes stay there."""
        sensors = [sensor for agent in spec.agents for sensor in agent.rig.of_type(self._kind)]
        ranges_m = [
            max(scan.range_m for scan in sensor.scans_of_cycle) if isinstance(sensor, Radar) else sensor.range_m
            for sensor in sensors
        ]
        distances_m = [
            range_m + math.hypot(sensor.pose.x_m, sensor.pose.y_m)
            for range_m, sensor in zip(ranges_m, sensors, strict=True)
        ]
        self.reach_m = max(distances_m, default=0.0)
        self._surroundings.load(spec, ray_view_radius_m(ranges_m))

    @property
    def tunnels(self) -> Tunnels:
        """The tunnels of the current map."""
        return self._surroundings.tunnels

    def take(self, count: int) -> list[RayScene]:
        """The first scenes, in a constant order as long as nothing else is loaded."""
        if count == 0:
            return []
        scenes = self._surroundings.built
        while len(scenes) < count:
            scenes.append(scenes[0].another())
        return scenes[:count]

    def build_ahead(self, rays: RayScene, state: WorldState) -> None:
        """Prepare one of the scenes for the position of the state's ego a while later, if it drives on."""
        rays.build_ahead(_predicted_position_m(state), self.reach_m)


def _predicted_position_m(state: WorldState) -> Float64Array:
    """(3,) position of the ego ``_LOOKAHEAD_S`` later, map frame."""
    return vector(state.ego, "x y z") + _LOOKAHEAD_S * vector(state.ego, "vx vy vz")
