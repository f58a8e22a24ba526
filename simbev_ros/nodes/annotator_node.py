"""The annotator node: bird's-eye-view grids, boxes and the lane under the ego at every tick."""

import math

import shapely
from nav_msgs.msg import OccupancyGrid
from sensor_msgs.msg import Image, PointCloud2
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from simbev_ros.annotation.bev import BevAnnotator
from simbev_ros.annotation.boxes import boxes
from simbev_ros.annotation.hazards import LabelledArea, hazard_areas
from simbev_ros.annotation.levels import Levels
from simbev_ros.assets.catalogue import load_models
from simbev_ros.config.scenario import Bev
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.msgs import topics
from simbev_ros.msgs.images import image_message
from simbev_ros.msgs.markers import box_markers
from simbev_ros.msgs.occupancy import occupancy_grid_message
from simbev_ros.msgs.tables import message_from_table
from simbev_ros.msgs.world import MAP_FRAME, hd_map_message
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.surroundings import Surroundings
from simbev_ros.palette import bev_color
from simbev_ros.scene.reach import reach_of
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.types import UInt16Array

_MESSAGE_TYPES = {"PointCloud2": PointCloud2, "Image": Image, "MarkerArray": MarkerArray, "String": String}


class AnnotatorNode(Participant):
    """Publishes /ego/bev/*, /ego/boxes* and /ego/hd_map."""

    def __init__(self, name: str) -> None:
        super().__init__(name)
        self._surroundings = Surroundings()
        self._bev: BevAnnotator | None = None
        self._network: RoadNetwork | None = None
        self._levels: Levels | None = None
        self._hazards: tuple[LabelledArea, ...] = ()

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there) and advertise the topics."""
        grid = spec.annotation.bev.grid
        static = self._surroundings.changed(spec, math.hypot(grid.rows, grid.columns) * grid.cell_m / 2.0)
        if static is not None:
            self._bev = BevAnnotator(static, load_models())
        self._network = load_network(spec.map)
        reach = reach_of(spec, self._network)
        area = shapely.Point(reach.center_m).buffer(reach.radius_m)
        layout = self._network.layout.near(area, margin_m=0.0)
        self._levels, self._hazards = Levels(layout), hazard_areas(spec.hazards, layout)
        recorded = list(topics.annotation_topics(spec))
        for topic in recorded:
            self.advertise(topic, _MESSAGE_TYPES[topic.type.rsplit("/", 1)[1]])
        for name in BEV_CLASSES:
            topic = topics.Topic(_grid_topic(spec.rig.agent, name), "nav_msgs/msg/OccupancyGrid")
            self.advertise(topic, OccupancyGrid)
        return [topic.name for topic in recorded]

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Annotate and publish a tick."""
        if state.tick < 0:
            return
        assert self._bev is not None and self._network is not None and self._levels is not None
        agent, annotation = spec.rig.agent, spec.annotation
        frame = f"{agent}/base_link"
        ego_level = self._levels.of_ego(state)
        labels = self._bev.labels(state, annotation.bev.grid, ego_level, self._hazards)
        self.publish(f"/{agent}/bev/labels", image_message(labels, state.stamp_ns, frame))
        if self.readers(f"/{agent}/bev/color"):
            self.publish(f"/{agent}/bev/color", image_message(bev_color(labels), state.stamp_ns, frame))
        self._publish_grids(labels, annotation.bev, state.stamp_ns, frame)
        table = boxes(state, annotation.box_radius_m, ego_level)
        self.publish(f"/{agent}/boxes", message_from_table(table, state.stamp_ns, MAP_FRAME))
        if self.readers(f"/{agent}/boxes/markers"):
            self.publish(f"/{agent}/boxes/markers", box_markers(table, state.stamp_ns))
        self.publish(topics.agent_topic(agent, "hd_map"), hd_map_message(self._network, state))

    def _publish_grids(self, labels: UInt16Array, bev: Bev, stamp_ns: int, frame: str) -> None:
        agent = frame.partition("/")[0]
        for index, name in enumerate(BEV_CLASSES):
            topic = _grid_topic(agent, name)
            if self.readers(topic):
                covered = (labels >> index & 1).astype(bool)
                self.publish(topic, occupancy_grid_message(covered, bev.grid, stamp_ns, frame))


def _grid_topic(agent: str, class_name: str) -> str:
    return f"/{agent}/bev/{class_name}/grid"
