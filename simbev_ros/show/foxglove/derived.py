"""Topics for displays that bags do not contain, made from the recorded messages as the graph's nodes make them."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.drawing.displays.box_markers import box_markers, world_markers
from simbev_ros.drawing.displays.detections import detections_2d, detections_3d
from simbev_ros.drawing.displays.ego_path import EgoPath, PathPose
from simbev_ros.drawing.displays.grids import occupancy_grid
from simbev_ros.drawing.displays.image_boxes import image_boxes
from simbev_ros.drawing.displays.map_markers import map_markers
from simbev_ros.drawing.displays.messages import rgb_image, serialize
from simbev_ros.drawing.displays.pictures import color_picture, compressed_picture
from simbev_ros.drawing.displays.status import EVENT, LANE, WEATHER, status
from simbev_ros.drawing.displays.table_points import table_points
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, UInt8Array, UInt16Array
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.ros.msgs.sensor_topics import camera_info_topic, camera_topics, picture_topics
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.scene.frames import ego_frame
from simbev_ros.schema.palette import bev_color
from simbev_ros.schema.scene.agents import agent_views, ego_row
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.simulation.sensors.mount import vector

_MALFORMED = (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError)
_Make = Callable[..., bytes]
"""Makes a serialized message from a stamp, ns, and the decoded messages of the sources."""
_MakePicture = Callable[[UInt8Array, int, str], bytes]
"""Makes a serialized message from a picture, its stamp, ns, and its frame."""


@dataclass(frozen=True, slots=True)
class Derivation:
    """How a topic is made.

    Attributes:
        name: The topic.
        type_name: Its type.
        sources: Recorded topics; each message of the first one leads to one of this topic.
    """

    name: str
    type_name: str
    sources: tuple[str, ...]
    _bag: SceneBag
    _make: _Make

    def make(self, messages: Sequence[RawMessage]) -> bytes:
        """The serialized message that follows from messages of the sources, in their order.

        Raises:
            BagError: A message is malformed.
        """
        try:
            return self._make(messages[0].stamp_ns, *(self._bag.decode(message) for message in messages))
        except _MALFORMED as error:
            words = " ".join(str(error).split())
            raise BagError(f"{self._bag.path}: {self.name} cannot be made: {words:.200}") from None


def derivations(bag: SceneBag) -> dict[str, Derivation]:
    """Topics of all agents that can be made of a bag and are not in it; none if its scene is not attached.

    Raises:
        BagError: The attached scene is damaged.
    """
    spec = bag.spec
    if spec is None:
        return {}
    parts = chain(_world(spec, bag), *(_of_agent(view, bag) for view in agent_views(spec)))
    found = (
        Derivation(topic.name, topic.type, sources, bag, make)
        for topic, sources, make in parts
        if topic.name not in bag.topics and all(source in bag.topics for source in sources)
    )
    return {derived.name: derived for derived in found}


_Part = tuple[Topic, tuple[str, ...], _Make]


def _world(spec: SceneSpec, bag: SceneBag) -> Iterator[_Part]:
    known = {topic.name: topic for topic in topics.world_displays(spec)}
    yield known[topics.WORLD_MARKERS], (topics.SIGNALS, topics.ACTORS, topics.LIGHTS), _world_markers
    yield known[topics.ACTOR_POINTS], (topics.ACTORS,), _points
    yield known[topics.SIGNAL_POINTS], (topics.SIGNALS,), _points
    yield known[topics.LIGHT_POINTS], (topics.ACTORS, topics.LIGHTS), lambda stamp, _, lamps: _points(stamp, lamps)
    for view in agent_views(spec):
        odometry = topics.odometry_name(view.rig.agent)
        yield known[topics.path_name(view.rig.agent)], (odometry,), _PathMaker(bag, odometry)
    yield known[topics.WEATHER_STATUS], (topics.WEATHER,), partial(_status, WEATHER)
    yield known[topics.EVENT_STATUS], (topics.EVENTS,), partial(_status, EVENT)


def _of_agent(view: SceneSpec, bag: SceneBag) -> Iterator[_Part]:
    yield from _labels(view)
    yield from _views(view)
    yield from _camera_infos(view)
    yield from _pictures(view, bag)


def _labels(view: SceneSpec) -> Iterator[_Part]:
    labels, frame = annotation_topics(view), ego_frame(view)
    yield labels.box_markers, (labels.boxes.name,), lambda stamp_ns, boxes: box_markers(point_array(boxes), stamp_ns)
    yield labels.detections, (labels.boxes.name,), lambda stamp_ns, boxes: detections_3d(point_array(boxes), stamp_ns)
    yield labels.box_points, (labels.boxes.name,), _points
    yield labels.bev_color, (labels.bev_labels.name,), partial(_bev_picture, frame)
    yield labels.lane_status, (labels.hd_map.name,), partial(_status, LANE)
    if labels.vector_map is not None and labels.map_markers is not None:
        yield labels.map_markers, (labels.vector_map.name,), _map_markers
    for index, name in enumerate(BEV_CLASSES):
        yield labels.grids[name], (labels.bev_labels.name, topics.ACTORS), partial(_grid, view, index)


def _views(view: SceneSpec) -> Iterator[_Part]:
    labels = annotation_topics(view)
    for camera, topic in labels.view_markers.items():
        frame = f"{view.rig.agent}/{camera}_optical"
        yield topic, (labels.views[camera].name,), partial(_of_views, image_boxes, frame)
    for camera, (visible, amodal) in labels.camera_detections.items():
        sources, frame = (labels.views[camera].name,), f"{view.rig.agent}/{camera}_optical"
        yield visible, sources, partial(_of_views, detections_2d, frame)
        yield amodal, sources, partial(_of_views, partial(detections_2d, prefix="amodal_"), frame)


def _camera_infos(view: SceneSpec) -> Iterator[_Part]:
    """The CameraInfo that the images of a camera share; bags of earlier versions have it beside each image only."""
    for camera in view.rig.of_type(Camera):
        beside = next(iter(camera_topics(view, camera).values())).info
        yield camera_info_topic(view, camera), (beside.name,), lambda _, info: serialize(info)


def _pictures(view: SceneSpec, bag: SceneBag) -> Iterator[_Part]:
    for camera in view.rig.of_type(Camera):
        images = camera_topics(view, camera)
        frame = f"{view.rig.agent}/{camera.name}_optical"
        for modality, pictures in picture_topics(view, camera).items():
            forms = images[modality].compressed.name, images[modality].raw.name
            recorded = next((name for name in forms if name in bag.topics), forms[0])
            yield pictures.raw, (recorded,), partial(_picture, rgb_image, modality, frame)
            yield pictures.compressed, (recorded,), partial(_picture, compressed_picture, modality, frame)


def _world_markers(stamp_ns: int, signals: Any, actors: Any, lamps: Any) -> bytes:
    return world_markers(point_array(actors), point_array(signals), point_array(lamps), stamp_ns)


def _points(stamp_ns: int, table: Any) -> bytes:
    return table_points(point_array(table), stamp_ns)


def _status(name: str, stamp_ns: int, message: Any) -> bytes:
    return status(name, _record(message), stamp_ns)


def _map_markers(stamp_ns: int, message: Any) -> bytes:
    return map_markers(_record(message), stamp_ns)


def _of_views(make: _Make, frame: str, stamp_ns: int, views: Any) -> bytes:
    return make(point_array(views), stamp_ns, frame)


def _picture(make: _MakePicture, modality: str, frame: str, stamp_ns: int, message: Any) -> bytes:
    return make(color_picture(modality, image_array(message)), stamp_ns, frame)


def _bev_picture(frame: str, stamp_ns: int, message: Any) -> bytes:
    return rgb_image(bev_color(_bev_labels(message)), stamp_ns, frame)


def _grid(view: SceneSpec, index: int, stamp_ns: int, labels: Any, table: Any) -> bytes:
    actors = point_array(table)
    ego = ego_row(view, actors)
    covered = (_bev_labels(labels) >> index & 1).astype(bool)
    frame, rpy_rad = ego_frame(view), vector(ego, "roll pitch yaw")
    return occupancy_grid(covered, view.annotation.bev.grid, stamp_ns, frame, rpy_rad)


def _bev_labels(message: Any) -> UInt16Array:
    """The grid; only images of 16-bit labels have one."""
    labels: AnyArray = image_array(message)
    if labels.dtype != np.uint16 or labels.ndim != 2:
        raise ValueError(f"its encoding is {message.encoding!r:.40}, not mono16")
    return labels


def _record(message: Any) -> dict[str, Any]:
    """The JSON object in a String."""
    record = parse_json(message.data)
    if not isinstance(record, dict):
        raise ValueError("its text is no JSON object")
    return record


class _PathMaker:
    """Makes the path up to a message; when the first one is wanted, it reads all of them."""

    def __init__(self, bag: SceneBag, topic: str) -> None:
        self._bag, self._topic = bag, topic
        self._path: EgoPath | None = None

    def __call__(self, stamp_ns: int, odometry: Any) -> bytes:
        if self._path is None:
            self._path = self._read()
        return self._path.message(PathPose.of_odometry(odometry, stamp_ns))

    def _read(self) -> EgoPath:
        path = EgoPath()
        try:
            for message in self._bag.messages([self._topic]):
                path.add(PathPose.of_odometry(self._bag.decode(message), message.stamp_ns))
        except BagError:  # it is reported when it is played
            return path
        return path
