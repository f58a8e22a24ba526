"""Relay for Nav2: the roads around the ego as a map of free space. Run ``python -m simbev_ros.ros.relays.nav2``."""

import numpy as np
from nav_msgs.msg import OccupancyGrid, Odometry
from rclpy.context import Context
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from std_msgs.msg import Header, String

from simbev_ros.foundation.geometry.transforms import inverse, matrices_from_xyz_quaternion
from simbev_ros.foundation.types import Float64Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.ros.msgs.world import map_from_base_link
from simbev_ros.ros.relays.nav2_map import FREE, OCCUPIED, LevelGrid, align
from simbev_ros.ros.relays.running import Relay, run
from simbev_ros.scene.frames import ego_from_base_link
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec

_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_POSES = 64


class Nav2Relay(Relay):
    """Publishes where there is no road as occupied, for the static layer of Nav2's costmaps.

    Topics, which can be remapped as usual: /ego/bev/road/grid, /ego/odom and /world/scene in; /map,
    latched, out.

    Parameters:
        period_s: Minimum simulated time between two maps.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__("nav2_relay", context=context)
        self._period_ns = round(float(self.declare_parameter("period_s", 0.5).value) * NS_PER_S)
        self._next_ns = 0
        self._poses: dict[int, tuple[str, Float64Array]] = {}
        self._base_link_from_ego: Float64Array = np.eye(4)
        self._map = self.create_publisher(OccupancyGrid, "/map", _LATCHED)
        self.listen(String, "/world/scene", self._on_scene, _LATCHED)
        self.listen(Odometry, "/ego/odom", self._on_odometry, qos_profile_sensor_data)
        self.listen(OccupancyGrid, "/ego/bev/road/grid", self._on_grid, qos_profile_sensor_data)

    def _on_scene(self, message: String) -> None:
        """Learn where base_link is in the ego frame, in which the grids are."""
        self._base_link_from_ego = inverse(ego_from_base_link(agent_view(SceneSpec.from_json(message.data))))

    def _on_odometry(self, message: Odometry) -> None:
        map_from_ego = map_from_base_link(message) @ self._base_link_from_ego
        self._poses[stamp_of(message.header.stamp)] = message.header.frame_id, map_from_ego
        while len(self._poses) > _POSES:
            del self._poses[next(iter(self._poses))]

    def _on_grid(self, message: OccupancyGrid) -> None:
        stamp_ns = stamp_of(message.header.stamp)
        restarted = stamp_ns < self._next_ns - self._period_ns
        if stamp_ns in self._poses and (stamp_ns >= self._next_ns or restarted):
            frame, map_from_ego = self._poses[stamp_ns]
            self._map.publish(drivable_map(message, map_from_ego, frame))
            self._next_ns = stamp_ns + self._period_ns


def drivable_map(road: OccupancyGrid, map_from_ego: Float64Array, frame: str) -> OccupancyGrid:
    """Map of the drivable area, with axes along those of a frame, from the grid of the road around the ego.

    Args:
        road: The grid, 100 where the road is, in the frame of the ego.
        map_from_ego: (4, 4) pose of that frame.
        frame: The frame in which the pose is.
    """
    info = road.info
    position, turn = info.origin.position, info.origin.orientation
    ego_from_grid = matrices_from_xyz_quaternion(
        np.array([position.x, position.y, position.z]), np.array([turn.x, turn.y, turn.z, turn.w])
    )
    covered = np.asarray(road.data, np.int8).reshape(info.height, info.width) > 0
    free = align(LevelGrid(covered, info.resolution, map_from_ego @ ego_from_grid))
    message = OccupancyGrid(header=Header(stamp=road.header.stamp, frame_id=frame))
    message.info.map_load_time, message.info.resolution = road.header.stamp, info.resolution
    message.info.height, message.info.width = free.cells.shape
    origin = message.info.origin
    origin.position.x, origin.position.y, origin.position.z = free.map_from_grid[:3, 3].tolist()
    message.data = np.where(free.cells, FREE, OCCUPIED).astype(np.int8).ravel().tolist()
    return message


if __name__ == "__main__":
    run(Nav2Relay)
