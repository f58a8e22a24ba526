"""The annotator node: publishes the labels of every tick, which are grids, boxes, occupancy, vector map and HD map.

Labels that follow from the world state alone are published at once. Boxes also state how many lidar and radar points
hit them and how visible they are to the cameras, so they wait for the clouds and instance images of their tick. In
lockstep, a thread completes the boxes of a tick while the next one is labeled. Where there are cores enough, several
such nodes share the labels.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rclpy.serialization import deserialize_message
from sensor_msgs.msg import CompressedImage, Image

from simbev_ros.annotation.boxes.points import add_point_counts, map_points
from simbev_ros.annotation.scene_annotator import MeshAnnotators, SceneAnnotator, SurroundingsLabels, meshes_radius_m
from simbev_ros.annotation.visibility.views import VIEW_DTYPE, ViewAnnotator, visibility
from simbev_ros.assets.actors.catalogue import load_models
from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.sensor import Sensor
from simbev_ros.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.hd_map import lane_record
from simbev_ros.msgs.annotation_topics import Label, annotation_topics, annotator_inputs, viewing_cameras
from simbev_ros.msgs.displays.box_markers import box_markers
from simbev_ros.msgs.displays.detections import detections_2d, detections_3d, label_info
from simbev_ros.msgs.displays.grids import occupancy_grid
from simbev_ros.msgs.displays.image_boxes import image_boxes
from simbev_ros.msgs.displays.map_markers import map_markers
from simbev_ros.msgs.displays.status import LANE, status
from simbev_ros.msgs.displays.table_points import table_points
from simbev_ros.msgs.images import image_message, labels_from_image
from simbev_ros.msgs.message_types import message_class
from simbev_ros.msgs.qos import qos_of, rclpy_qos
from simbev_ros.msgs.stamps import serialized_stamp_ns
from simbev_ros.msgs.tables import message_from_table, table_from_cdr
from simbev_ros.msgs.topic import Topic
from simbev_ros.msgs.world import MAP_FRAME, record_message
from simbev_ros.nodes.participant import Participant
from simbev_ros.nodes.ros.names import NodeName
from simbev_ros.nodes.sensor_join import SensorJoin
from simbev_ros.nodes.surroundings import Surroundings
from simbev_ros.palette import bev_color
from simbev_ros.process_memory import freeze_after_loading
from simbev_ros.recording.image_codecs import decode_labels
from simbev_ros.render.frame import CameraView
from simbev_ros.scene.frames import ego_frame
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.scene.state import WorldState
from simbev_ros.semantics import BEV_CLASSES
from simbev_ros.sensors.mount import map_from_sensor, vector
from simbev_ros.types import AnyArray, Float64Array, Table, UInt16Array

_LIVE_PATIENCE_TICKS = 8
"""Live: ticks after which boxes are published without the messages still missing.

Longer than the delay of a lidar or camera that keeps up.
"""

_NOTHING_SEEN: Table = np.zeros(0, VIEW_DTYPE)
_POINT_COLUMNS = ("x", "y", "z")
_VIEW_COLUMNS = VIEW_DTYPE.names or ()
_Reading = Callable[[], AnyArray]
"""Waits until a sensor's message is read, and returns its array or raises what malformed messages do."""


class _Tick(NamedTuple):
    """A tick whose boxes wait for messages of the sensors."""

    state: WorldState
    boxes: Table


class _BoxLabels(NamedTuple):
    """Boxes of a tick, and the table of those that each camera sees, empty if its message was malformed."""

    boxes: Table
    views: Mapping[str, Table]


class AnnotatorNode(Participant):
    """Annotates every tick of a scene and publishes the labels."""

    reuses_large_buffers = True

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self._compressed = self.declare_read_only(
            "compressed", True, "Read the compressed instance images instead of the raw ones"
        )
        labels = self.declare_read_only(
            "scope", list(Label), "What this node labels", allowed=f"each one of {', '.join(Label)}"
        )
        if unknown := [label for label in labels if label not in list(Label)]:
            raise InputError(f"parameter scope: {unknown[0]!r}; allowed: {', '.join(Label)}")
        self._labels = frozenset(map(Label, labels))
        self._has_objects = not self._labels.isdisjoint((Label.BOXES, Label.VIEWS))
        self._surroundings = Surroundings(lambda static: MeshAnnotators(static, load_models()))
        self._views = ViewAnnotator(load_models())
        self._sensors: dict[str, Topic] = {}
        self._subscriptions_of: dict[str, Any] = {}
        self._join: SensorJoin[_Tick, _Reading] = SensorJoin({})
        self._has_begun = False
        self._threads = self.meter.pool("label")
        self._boxes_thread = ThreadPoolExecutor(1)  # one tick after the other
        self._started: list[Future[_BoxLabels]] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around the ego (kept while scenes stay there), advertise topics, subscribe to sensors."""
        wait(self._started)  # the scene before may have been reset
        with freeze_after_loading():
            meshes = self._surroundings.load(spec, meshes_radius_m(spec.annotation))
            self._network = load_network(spec.map)
            self._scene = SceneAnnotator(spec, self._network, meshes)
        self._topics = topics = annotation_topics(spec)
        self._subscribe_to_sensors(spec)
        recorded = [topic for label in sorted(self._labels) for topic in topics.by_label[label]]
        displayed = [topic for label in sorted(self._labels) for topic in topics.displays[label]]
        for topic in (*recorded, *displayed):
            self.advertise(topic)
        self.advertise_typed(spec)
        if Label.SURROUNDINGS in self._labels:
            bits = {1 << index: name for index, name in enumerate(BEV_CLASSES)}
            self.publish_once(topics.bev_label_info, label_info, bits, spec.start_ns, ego_frame(spec))
        return [topic.name for topic in recorded]

    def _subscribe_to_sensors(self, spec: SceneSpec) -> None:
        """Subscribe to the topics that the boxes need; subscriptions are kept for later scenes with the same topic."""
        self._sensors = annotator_inputs(spec, compressed_images=self._compressed, labels=self._labels)
        names = {topic.name for topic in self._sensors.values()}
        for name in self._subscriptions_of.keys() - names:
            self.inputs.remove(self._subscriptions_of[name])
            self.destroy_subscription(self._subscriptions_of.pop(name))
        for sensor, topic in self._sensors.items():
            if topic.name not in self._subscriptions_of:
                qos, callback = rclpy_qos(qos_of(topic, live=self.live)), self._make_callback(sensor, topic)
                kind = message_class(topic.type)
                self._subscriptions_of[topic.name] = self.create_subscription(kind, topic.name, callback, qos, raw=True)
                self.inputs.append(self._subscriptions_of[topic.name])
        periods = {sensor: topic.period_ticks for sensor, topic in self._sensors.items()}
        self._has_begun = False
        self._join = SensorJoin(periods, _LIVE_PATIENCE_TICKS if self.live else None)

    def _make_callback(self, sensor: str, topic: Topic) -> Callable[[bytes], None]:
        def receive(payload: bytes) -> None:
            spec, stamp_ns = self.spec, self.read(topic.name, partial(serialized_stamp_ns, payload, topic.type))
            if spec is not None and stamp_ns is not None and self._join.is_awaited(sensor, spec.tick_of(stamp_ns)):
                reading = self._threads.submit(self._read_sensor, spec, sensor, payload).result
                self._join.add_message(sensor, spec.tick_of(stamp_ns), reading)
                self._publish_ready_boxes(spec)

        return receive

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Annotate a tick and publish all but its boxes, which wait for the messages of the sensors."""
        if state.tick < 0:
            return
        if not self._has_begun:  # a bag that is played back may lack topics of the scene's rig
            self._has_begun = True
            self._join.give_up(name for name, topic in self._sensors.items() if not self._is_sent(topic))
        if Label.SURROUNDINGS in self._labels:
            with self.meter.part("label"):
                labels = self._scene.surroundings(state)
            with self.meter.part("message"):
                self._publish_surroundings(spec, state, labels)
        if self._has_objects:
            with self.meter.part("label"):
                self._join.expect(state.tick, _Tick(state, self._scene.boxes(state)))

    def _is_sent(self, topic: Topic) -> bool:
        return bool(self._subscriptions_of[topic.name].get_publisher_count())

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Report ticks of the lead-in, and those without boxes; others are finished when their boxes are published."""
        if state.tick < 0 or not self._has_objects:
            super().finish(spec, state)
        else:
            self._publish_ready_boxes(spec)

    def _publish_surroundings(self, spec: SceneSpec, state: WorldState, labels: SurroundingsLabels) -> None:
        topics, stamp_ns, frame = self._topics, state.stamp_ns, ego_frame(spec)
        self.publish(topics.bev_labels.name, image_message(labels.grid, stamp_ns, frame))
        if self.reader_count(topics.bev_color.name):
            self.publish(topics.bev_color.name, image_message(bev_color(labels.grid), stamp_ns, frame))
        self._publish_grids(labels.grid, spec, state)
        if topics.occupancy is not None and labels.voxels is not None:
            self.publish(topics.occupancy.name, message_from_table(labels.voxels, stamp_ns, frame))
        if topics.vector_map is not None and labels.roads is not None:
            self.publish(topics.vector_map.name, record_message(labels.roads, stamp_ns))
            self.publish_display(topics.map_markers, map_markers, labels.roads, stamp_ns)
        lane = lane_record(self._network, vector(state.ego, "x y z"), float(state.ego["yaw"]))
        self.publish(topics.hd_map.name, record_message(lane, stamp_ns))
        self.publish_display(topics.lane_status, status, LANE, lane, stamp_ns)
        self.publish_typed(topics.hd_map.name, lane, stamp_ns)

    def _publish_grids(self, grid: UInt16Array, spec: SceneSpec, state: WorldState) -> None:
        geometry, frame = spec.annotation.bev.grid, ego_frame(spec)
        rpy_rad = vector(state.ego, "roll pitch yaw")
        for index, name in enumerate(BEV_CLASSES):
            topic = self._topics.grids[name]
            if self.reader_count(topic.name):
                covered = (grid >> index & 1).astype(bool)
                self.publish(topic.name, occupancy_grid(covered, geometry, state.stamp_ns, frame, rpy_rad))

    def _publish_ready_boxes(self, spec: SceneSpec) -> None:
        """Start to complete boxes and views of all ticks whose messages are there or overdue; then publish them."""
        for tick, messages in self._join.release():
            labels = self._boxes_thread.submit(self._complete_boxes, spec, tick, messages)
            self._started = [labels]
            self.finish_after(spec, tick.state.tick, [labels], partial(self._publish_boxes, spec, tick.state, labels))

    def _complete_boxes(self, spec: SceneSpec, tick: _Tick, messages: dict[str, _Reading]) -> _BoxLabels:
        """Count the points in a tick's boxes, and the pixels that show them."""
        with self.meter.part("receive"):
            readings = {sensor: self.read(self._sensors[sensor].name, reading) for sensor, reading in messages.items()}
        with self.meter.part("label"):
            arrays = {sensor: array for sensor, array in readings.items() if array is not None}
            counting = self._threads.submit(_count_points, spec, tick, arrays) if Label.BOXES in self._labels else None
            cameras = [camera for camera in viewing_cameras(spec.rig, spec.annotation) if camera.name in readings]
            views = self._views_of(tick, cameras, arrays) if Label.VIEWS in self._labels else arrays
            views = {camera.name: views.get(camera.name, _NOTHING_SEEN) for camera in cameras}
            if counting is None:
                return _BoxLabels(tick.boxes, views)
            boxes = counting.result()
            boxes["visibility"] = visibility(boxes["id"], views.values())
        return _BoxLabels(boxes, views)

    def _publish_boxes(self, spec: SceneSpec, state: WorldState, labels: Future[_BoxLabels]) -> None:
        topics, (boxes, views) = self._topics, labels.result()
        if Label.BOXES in self._labels:
            self.publish(topics.boxes.name, message_from_table(boxes, state.stamp_ns, MAP_FRAME))
            self.publish_display(topics.box_markers, box_markers, boxes, state.stamp_ns)
            self.publish_display(topics.detections, detections_3d, boxes, state.stamp_ns)
            self.publish_typed(topics.boxes.name, boxes, state.stamp_ns)
            self.publish_display(topics.box_points, table_points, boxes, state.stamp_ns)
        if Label.VIEWS in self._labels:
            for camera, table in views.items():
                frame = f"{spec.rig.agent}/{camera}_optical"
                self.publish(topics.views[camera].name, message_from_table(table, state.stamp_ns, frame))
                self.publish_display(topics.view_markers[camera], image_boxes, table, state.stamp_ns, frame)
                visible, amodal = topics.camera_detections[camera]
                self.publish_display(visible, detections_2d, table, state.stamp_ns, frame)
                self.publish_display(amodal, detections_2d, table, state.stamp_ns, frame, "amodal_")
                self.publish_typed(topics.views[camera].name, table, state.stamp_ns)

    def _views_of(self, tick: _Tick, cameras: Sequence[Camera], images: Mapping[str, AnyArray]) -> dict[str, Table]:
        """What the cameras whose images are there see of the boxes."""
        seeing = [camera for camera in cameras if camera.name in images]
        views = [CameraView(camera.model, camera.pose.ego_from_sensor, ("instance",)) for camera in seeing]
        ids = [images[camera.name] for camera in seeing]
        tables = self._views.views(tick.state, tick.boxes, views, ids, self._threads)
        return dict(zip((camera.name for camera in seeing), tables, strict=True))

    def _read_sensor(self, spec: SceneSpec, sensor: str, payload: bytes) -> AnyArray:
        """The points of a serialized cloud; of a camera, the (H, W) object ids of its instance image or its view."""
        with self.meter.part("receive"):
            return self._decode(spec, sensor, payload)

    def _decode(self, spec: SceneSpec, sensor: str, payload: bytes) -> AnyArray:
        camera = next((camera for camera in viewing_cameras(spec.rig, spec.annotation) if camera.name == sensor), None)
        if camera is None:
            return table_from_cdr(payload, _POINT_COLUMNS)
        if Label.VIEWS not in self._labels:
            return table_from_cdr(payload, _VIEW_COLUMNS)[list(_VIEW_COLUMNS)].astype(VIEW_DTYPE)
        if self._compressed:
            ids = decode_labels(bytes(deserialize_message(payload, CompressedImage).data))
        else:
            ids = labels_from_image(deserialize_message(payload, Image))
        if ids.shape != (camera.height_px, camera.width_px):
            raise ValueError(f"has {ids.shape[1]} x {ids.shape[0]} pixels")
        return ids

    def close(self) -> None:
        """Stop the threads."""
        self._boxes_thread.shutdown()
        self._threads.shutdown()


def _count_points(spec: SceneSpec, tick: _Tick, arrays: Mapping[str, AnyArray]) -> Table:
    """The tick's boxes with the number of points in them."""
    lidar_m, radar_m = (_clouds_m(spec.rig.of_type(kind), tick.state, arrays) for kind in (Lidar, Radar))
    return add_point_counts(tick.boxes, lidar_m, radar_m)


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
