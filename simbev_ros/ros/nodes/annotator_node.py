"""The annotator node: publishes the labels of ticks, which are grids, boxes, occupancy, vector map and HD map.

Labels that follow from the world state alone are published at once. Boxes also state how many lidar and radar points
hit them and how visible they are to the cameras, so they wait for the clouds and instance images of their tick. In
lockstep, a thread completes the boxes of a tick while the next one is labeled. A node labels all agents of a scene.
Where there are cores enough, several such nodes share the agents and the labels.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.drawing.displays.detections import label_info
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.process_memory import freeze_after_loading
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.maps.build import load_network
from simbev_ros.maps.hd_map import lane_record
from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.msgs.annotation_topics import Label
from simbev_ros.ros.msgs.images import image_message
from simbev_ros.ros.msgs.tables import message_from_table
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.topics import ACTORS
from simbev_ros.ros.msgs.world import MAP_FRAME, record_message
from simbev_ros.ros.nodes.annotated_agent import AgentTick, AnnotatedAgent
from simbev_ros.ros.nodes.joined_inputs import JoinedInputs
from simbev_ros.ros.nodes.participant import Participant
from simbev_ros.ros.nodes.surroundings import Surroundings
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.schema.views import VIEW_DTYPE
from simbev_ros.simulation.annotation.scene_annotator import MeshAnnotators, SurroundingsLabels, meshes_radius_m
from simbev_ros.simulation.annotation.visibility.views import ViewAnnotator, visibility
from simbev_ros.simulation.sensors.mount import vector

_LIVE_PATIENCE_TICKS = 8
"""Live: ticks after which boxes are published without the messages still missing.

Longer than the delay of a lidar or camera that keeps up.
"""

_NOTHING_SEEN: Table = np.zeros(0, VIEW_DTYPE)
_Reading = Callable[[], AnyArray]
"""Waits until a sensor's message is read, and returns its array or raises what malformed messages do."""


class _Input(NamedTuple):
    """A topic that is read, and its sensor."""

    agent: AnnotatedAgent
    sensor: str
    topic: Topic


class _BoxLabels(NamedTuple):
    """Boxes of a tick, and the table of those that each camera sees, empty if its message was malformed."""

    boxes: Table
    views: Mapping[str, Table]


class AnnotatorNode(Participant):
    """Annotates the ticks of a scene that have labels, for each of its agents, and publishes the labels."""

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
        self._agents: list[AnnotatedAgent] = []
        self._inputs: dict[str, _Input] = {}
        self._joined: JoinedInputs[dict[AnnotatedAgent, AgentTick], _Reading] = JoinedInputs(
            self, _LIVE_PATIENCE_TICKS, self._start_reading, self._publish_ready_boxes
        )
        self._threads = self.meter.pool("label")
        self._boxes_thread = ThreadPoolExecutor(1)  # one tick after the other
        self._started: list[Future[_BoxLabels]] = []

    def start_scene(self, spec: SceneSpec) -> list[str]:
        """Load the meshes around agents (kept while scenes stay there), advertise topics, subscribe to sensors."""
        wait(self._started)  # the scene before may have been reset
        with freeze_after_loading():
            self._agents = self._load_agents(spec)
        self._subscribe_to_sensors()
        recorded = []
        for agent in self._agents:
            for topic in (topic for label in sorted(self._labels) for topic in agent.topics.by_label[label]):
                self.advertise(topic)
                recorded.append(topic.name)
        self.advertise_derived(spec)
        if Label.SURROUNDINGS in self._labels:
            bits = {1 << index: name for index, name in enumerate(BEV_CLASSES)}
            for agent in self._agents:
                self.advertise(agent.topics.bev_label_info)
                self.publish_once(agent.topics.bev_label_info, label_info, bits, spec.start_ns, agent.frame)
        return recorded

    def _load_agents(self, spec: SceneSpec) -> list[AnnotatedAgent]:
        """The agents that this node serves, which share the meshes around all agents of the scene."""
        views = self.served_views(spec)
        if not views:
            return []
        meshes = self._surroundings.load(spec, meshes_radius_m(spec))
        self._network = load_network(spec.map)
        return [
            AnnotatedAgent.of(view, self._network, meshes, self._labels, compressed_images=self._compressed)
            for view in views
        ]

    def _subscribe_to_sensors(self) -> None:
        """Subscribe to the topics that the boxes need."""
        self._inputs = {
            agent.key(sensor): _Input(agent, sensor, topic)
            for agent in self._agents
            for sensor, topic in agent.sensors.items()
        }
        self._joined.start_scene({key: each.topic for key, each in self._inputs.items()})

    def _start_reading(self, key: str, payload: bytes) -> _Reading:
        """Let a thread read a sensor's message."""
        return self._threads.submit(self._read_sensor, self._inputs[key], payload).result

    def is_due(self, spec: SceneSpec, tick: int) -> bool:
        """Whether there is any agent to label at the tick."""
        return tick >= 0 and any(agent.is_due(tick) for agent in self._agents)

    def process(self, spec: SceneSpec, state: WorldState) -> None:
        """Annotate a tick and publish all but its boxes, which wait for the messages of the sensors."""
        if state.tick < 0:
            return
        states = {agent: agent.view.ego_state(state) for agent in self._agents if agent.is_due(state.tick)}
        if Label.SURROUNDINGS in self._labels:
            for agent, seen in states.items():
                with self.meter.part("label"):
                    labels = agent.annotator.surroundings(seen)
                with self.meter.part("message"):
                    self._publish_surroundings(agent, seen, labels)
        if self._awaits_sensors:
            with self.meter.part("label"):
                ticks = {agent: AgentTick(seen, agent.annotator.boxes(seen)) for agent, seen in states.items()}
                self._joined.expect(state.tick, ticks)  # without agents as well, so that ticks leave in order

    @property
    def _awaits_sensors(self) -> bool:
        """Whether ticks are finished when the sensors' messages are there."""
        return self._has_objects and bool(self._agents)

    def finish(self, spec: SceneSpec, state: WorldState) -> None:
        """Report ticks of the lead-in, and those without boxes; others are finished when their boxes are published."""
        if state.tick < 0 or not self._awaits_sensors:
            super().finish(spec, state)
        else:
            self._publish_ready_boxes(spec)

    def _publish_surroundings(self, agent: AnnotatedAgent, state: WorldState, labels: SurroundingsLabels) -> None:
        topics, stamp_ns, frame = agent.topics, state.stamp_ns, agent.frame
        contents: dict[str, Any] = {ACTORS: state.actors, topics.bev_labels.name: labels.grid}
        self.publish(topics.bev_labels.name, image_message(labels.grid, stamp_ns, frame))
        if topics.occupancy is not None and labels.voxels is not None:
            self.publish(topics.occupancy.name, message_from_table(labels.voxels, stamp_ns, frame))
        if topics.vector_map is not None and labels.roads is not None:
            self.publish(topics.vector_map.name, record_message(labels.roads, stamp_ns))
            contents[topics.vector_map.name] = labels.roads
        lane = lane_record(self._network, vector(state.ego, "x y z"), float(state.ego["yaw"]))
        self.publish(topics.hd_map.name, record_message(lane, stamp_ns))
        self.publish_derived(stamp_ns, contents | {topics.hd_map.name: lane})

    def _publish_ready_boxes(self, spec: SceneSpec) -> None:
        """Start to complete boxes and views of all ticks that do not wait any longer; then publish them."""
        for number, ticks, messages in self._joined.release():
            labels = [
                self._boxes_thread.submit(self._complete_boxes, agent, tick, messages) for agent, tick in ticks.items()
            ]
            self._started = labels or self._started
            self.finish_after(spec, number, labels, partial(self._publish_objects, ticks, labels))

    def _complete_boxes(self, agent: AnnotatedAgent, tick: AgentTick, messages: Mapping[str, _Reading]) -> _BoxLabels:
        """Count the points in a tick's boxes around an agent, and the pixels that show them."""
        own = {sensor: messages[key] for sensor in agent.sensors if (key := agent.key(sensor)) in messages}
        with self.meter.part("receive"):
            readings = {sensor: self.read(agent.sensors[sensor].name, reading) for sensor, reading in own.items()}
        with self.meter.part("label"):
            arrays = {sensor: array for sensor, array in readings.items() if array is not None}
            counting = self._threads.submit(agent.count_points, tick, arrays) if Label.BOXES in self._labels else None
            is_viewing = Label.VIEWS in self._labels
            views = agent.sensor_views(self._views, tick, arrays, self._threads) if is_viewing else arrays
            cameras = [camera.name for camera in agent.cameras if camera.name in readings]
            views = {camera: views.get(camera, _NOTHING_SEEN) for camera in cameras}
            if counting is None:
                return _BoxLabels(tick.boxes, views)
            boxes = counting.result()
            boxes["visibility"] = visibility(boxes["id"], views.values())
        return _BoxLabels(boxes, views)

    def _publish_objects(self, ticks: Mapping[AnnotatedAgent, AgentTick], labels: Sequence[Future[_BoxLabels]]) -> None:
        """Publish the boxes and views of all agents with labels at a tick."""
        for (agent, tick), of_agent in zip(ticks.items(), labels, strict=True):
            boxes, views = of_agent.result()
            if Label.BOXES in self._labels:
                self._publish_boxes(agent, boxes, tick.state.stamp_ns)
            if Label.VIEWS in self._labels:
                self._publish_views(agent, views, tick.state.stamp_ns)

    def _publish_boxes(self, agent: AnnotatedAgent, boxes: Table, stamp_ns: int) -> None:
        topic = agent.topics.boxes.name
        self.publish(topic, message_from_table(boxes, stamp_ns, MAP_FRAME))
        self.publish_derived(stamp_ns, {topic: boxes})

    def _publish_views(self, agent: AnnotatedAgent, views: Mapping[str, Table], stamp_ns: int) -> None:
        for camera, table in views.items():
            topic, frame = agent.topics.views[camera].name, f"{agent.view.agent}/{camera}_optical"
            self.publish(topic, message_from_table(table, stamp_ns, frame))
            self.publish_derived(stamp_ns, {topic: table})

    def _read_sensor(self, source: _Input, payload: bytes) -> AnyArray:
        """Decode a sensor's message."""
        with self.meter.part("receive"):
            return source.agent.decode(source.sensor, payload, compressed_images=self._compressed)

    def close(self) -> None:
        """Stop the threads."""
        self._boxes_thread.shutdown()
        self._threads.shutdown()
