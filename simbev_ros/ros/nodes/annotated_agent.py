"""An agent that an annotator serves: its topics, its labels, and what its sensors' messages add to its boxes.

Serialized messages enter ``decode``; arrays leave, which together with a tick's state and boxes enter ``count_points``
and ``sensor_views``.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import NamedTuple, Self

from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, Image

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Sensor
from simbev_ros.drawing.displays.messages import CLOUD
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.recording.compressed_clouds import COMPRESSED_CLOUD
from simbev_ros.recording.image_codecs import decode_labels
from simbev_ros.ros.msgs.annotation_topics import (
    AnnotationTopics,
    Label,
    annotation_topics,
    annotator_inputs,
    viewing_cameras,
)
from simbev_ros.ros.msgs.images import labels_from_image
from simbev_ros.ros.msgs.tables import table_from_cdr
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.scene.frames import ego_frame
from simbev_ros.schema.box_points import add_point_counts
from simbev_ros.schema.map_points import map_points
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.simulation.annotation.scene_annotator import MeshAnnotators, SceneAnnotator
from simbev_ros.simulation.annotation.visibility.views import ViewAnnotator
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.sensors.mount import map_from_sensor

_POINT_COLUMNS = ("x", "y", "z")
_VIEW_COLUMNS = VIEW_DTYPE.names or ()


class AgentTick(NamedTuple):
    """A tick as an agent sees it, and the boxes around the agent, which wait for messages of its sensors."""

    state: WorldState
    boxes: Table


@dataclass(frozen=True, slots=True, eq=False)
class AnnotatedAgent:
    """An agent that an annotator serves in one scene. Agents may have equal rigs, so this one equals itself only.

    Attributes:
        view: The agent's view of the scene.
        labels: What is labeled.
        annotator: Makes the labels that follow from the world state.
        topics: Topics of the labels.
        sensors: Topics that are read, by the sensor's name.
        cameras: Cameras whose views of the boxes are published.
    """

    view: AgentView
    labels: Collection[Label]
    annotator: SceneAnnotator
    topics: AnnotationTopics
    sensors: Mapping[str, Topic]
    cameras: Sequence[Camera]

    @classmethod
    def of(
        cls,
        view: AgentView,
        network: RoadNetwork,
        meshes: MeshAnnotators,
        labels: Collection[Label],
        *,
        compressed_images: bool,
    ) -> Self:
        """The agent that has this view of a scene."""
        return cls(
            view,
            labels,
            SceneAnnotator(view, network, meshes),
            annotation_topics(view),
            annotator_inputs(view, compressed_images=compressed_images, labels=labels),
            viewing_cameras(view.rig, view.annotation),
        )

    @property
    def frame(self) -> str:
        """Frame of the labels of the agent's surroundings."""
        return ego_frame(self.view)

    def is_due(self, tick: int) -> bool:
        """Whether a tick has labels."""
        return tick % self.topics.boxes.period_ticks == 0

    def key(self, sensor: str) -> str:
        """Name of one of its sensors that is unique in the scene."""
        return f"{self.view.agent}/{sensor}"

    def decode(self, sensor: str, payload: bytes, *, compressed_images: bool) -> AnyArray:
        """The points of a serialized cloud; of a camera, the (H, W) object ids of its instance image or its view.

        Raises:
            ValueError: The message is malformed, among other exceptions that malformed messages cause.
        """
        camera = next((camera for camera in self.cameras if camera.name == sensor), None)
        if camera is None:
            lidar = next((lidar for lidar in self.view.rig.of_type(Lidar) if lidar.name == sensor), None)
            is_compressed = lidar is not None and lidar.compression is not None
            return table_from_cdr(payload, _POINT_COLUMNS, COMPRESSED_CLOUD if is_compressed else CLOUD)
        if Label.VIEWS not in self.labels:
            return table_from_cdr(payload, _VIEW_COLUMNS)[list(_VIEW_COLUMNS)].astype(VIEW_DTYPE)
        if compressed_images:
            ids = decode_labels(bytes(deserialize_message(payload, CompressedImage).data))
        else:
            ids = labels_from_image(deserialize_message(payload, Image))
        if ids.shape != (camera.height_px, camera.width_px):
            raise ValueError(f"has {ids.shape[1]} x {ids.shape[0]} pixels")
        return ids

    def count_points(self, tick: AgentTick, arrays: Mapping[str, AnyArray]) -> Table:
        """The tick's boxes with the number of points in them.

        Args:
            tick: The tick.
            arrays: Decoded messages, by the sensor's name.
        """
        lidar_m, radar_m = (_clouds_m(self.view.rig.of_type(kind), tick.state, arrays) for kind in (Lidar, Radar))
        return add_point_counts(tick.boxes, lidar_m, radar_m)

    def sensor_views(
        self, annotator: ViewAnnotator, tick: AgentTick, images: Mapping[str, AnyArray], threads: ThreadPoolExecutor
    ) -> dict[str, Table]:
        """Views of the boxes by the cameras with an image, by the camera's name."""
        seeing = [camera for camera in self.cameras if camera.name in images]
        views = [CameraView(camera.model, camera.pose.ego_from_sensor, ("instance",)) for camera in seeing]
        ids = [images[camera.name] for camera in seeing]
        tables = annotator.views(tick.state, tick.boxes, views, ids, threads)
        return dict(zip((camera.name for camera in seeing), tables, strict=True))


def _clouds_m(
    sensors: Iterable[Sensor], state: WorldState, arrays: Mapping[str, AnyArray]
) -> list[Float64Array] | None:
    """(N, 3) points of each sensor that has sent a cloud, map frame; None if none has."""
    clouds_m = []
    for sensor in sensors:
        if sensor.name in arrays:
            carrier = state.ego if isinstance(sensor, Lidar) and sensor.rolling else None
            clouds_m.append(map_points(arrays[sensor.name], map_from_sensor(sensor.pose, state), carrier))
    return clouds_m or None
