"""The lidar node: casts the rays of the rig's lidars and publishes their clouds."""

from typing import NamedTuple

from sensor_msgs.msg import PointCloud2

from simbev_ros.assets.catalogue import load_models
from simbev_ros.config.lidar import Lidar
from simbev_ros.msgs.tables import message_from_table
from simbev_ros.msgs.topics import Topic
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.surroundings import Surroundings
from simbev_ros.raycast.scene import RayScene
from simbev_ros.scene.spec import NS_PER_S, SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.sensors.lidar import LidarModel
from simbev_ros.sensors.mount import map_from_sensor

_BESIDE_EGO_M = 20.0  # sensors may be mounted so far from it


class _Mounted(NamedTuple):
    lidar: Lidar
    model: LidarModel
    period_ticks: int


class LidarNode(Participant):
    """Serves all lidars of the rig."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._surroundings = Surroundings()
        self._rays: RayScene | None = None
        self._mounted: list[_Mounted] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the lidars' topics."""
        lidars = spec.rig.of_type(Lidar)
        static = self._surroundings.changed(spec, max((lidar.range_m for lidar in lidars), default=0.0) + _BESIDE_EGO_M)
        if static is not None:
            self._rays = RayScene(static, load_models())
        self._mounted = []
        recorded = []
        for lidar in lidars:
            period = spec.period_ticks(lidar.rate_hz)
            model = LidarModel(lidar, spec.seed, turn_s=period * spec.tick_ns / NS_PER_S)
            self._mounted.append(_Mounted(lidar, model, period))
            for cloud, published in (("points", lidar.points), ("semantic_points", lidar.semantic_points)):
                if published:
                    name = f"/{spec.rig.agent}/{lidar.name}/{cloud}"
                    self.advertise(Topic(name, "sensor_msgs/msg/PointCloud2", period, sensor=True), PointCloud2)
                    recorded.append(name)
        return recorded

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Cast what is due, and publish it. Rays pass through the ego and through its rider."""
        due = [mounted for mounted in self._mounted if state.tick % mounted.period_ticks == 0]
        for lidar, model, _ in due:
            assert self._rays is not None
            center_m = map_from_sensor(lidar.pose, state)[:3, 3]
            self._rays.update(state, center_m, lidar.range_m, state.ego_ids)
            scan = model.scan(self._rays, state)
            if state.tick < 0:  # clouds of the lead-in only warm the ray caster up
                continue
            frame = f"{spec.rig.agent}/{lidar.name}"
            if lidar.points:
                self.publish(f"/{frame}/points", message_from_table(scan.points, state.stamp_ns, frame))
            if lidar.semantic_points:
                message = message_from_table(scan.semantic_points, state.stamp_ns, frame)
                self.publish(f"/{frame}/semantic_points", message)
