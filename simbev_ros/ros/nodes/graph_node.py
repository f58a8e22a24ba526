"""The base class of all nodes of the graph: parameters with descriptors, reports of finished ticks, diagnostics."""

import traceback
from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import Any, ParamSpec, TypeVar

from diagnostic_msgs.msg import DiagnosticArray
from pydantic import ValidationError
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.serialization import deserialize_message
from std_msgs.msg import Header, String

from simbev_ros.config.base import Model
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError, SimbevError
from simbev_ros.recording.qos import QosProfile
from simbev_ros.ros.conventions.diagnostics import frequency_status, load_status
from simbev_ros.ros.conventions.names import NamespacedNode, NodeName, ros_name
from simbev_ros.ros.conventions.parameters import declare_read_only
from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.displays import SceneDisplay, scene_displays
from simbev_ros.ros.msgs.message_types import is_installed, message_class
from simbev_ros.ros.msgs.qos import LATCHED, STEERING, qos_of, rclpy_qos
from simbev_ros.ros.msgs.qos_overrides import override_options
from simbev_ros.ros.msgs.signing import Signer, content_of
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.ros.msgs.typed_topics import TypedTopic, typed_topics
from simbev_ros.ros.nodes.load_meter import LoadMeter
from simbev_ros.ros.nodes.reports import Report, report_message
from simbev_ros.ros.nodes.scene_inbox import SceneInbox
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.scene.request import SceneRequest
from simbev_ros.schema.scene.spec import SceneSpec

_MAX_REASON_CHARACTERS = 300

Section = TypeVar("Section", bound=Model)
_Content = TypeVar("_Content")
_Arguments = ParamSpec("_Arguments")

MALFORMED = (SimbevError, *FOREIGN_ERRORS)
"""Exceptions from reading a malformed message; rclpy's own, of a truncated one, is a RuntimeError."""


class GraphNode(NamespacedNode):
    """Base of every node of the graph.

    Args:
        name: Its name; in /sync/ready it is the one within the graph, also if ROS's arguments rename the node.

    Attributes:
        node_name: Its name.
        takes_message_info: Whether it has callbacks that take message and message info, which rclpy's events executor
            cannot call.
        reuses_large_buffers: Whether it allocates and frees large arrays at each tick, so that its process had better
            keep freed memory.
    """

    takes_message_info = False
    reuses_large_buffers = False

    def __init__(self, name: NodeName) -> None:
        super().__init__(name)
        self.node_name = name
        self.live: bool = self.declare_read_only(
            "live", False, "Paced by the wall clock; sensor topics are best effort"
        )
        self.reliable: bool = self.declare_read_only(
            "reliable", False, "Sensor topics are reliable although it is live"
        )
        self.meter = LoadMeter()
        self.signer = Signer.from_environment()
        self._simulated_ns = 0
        self._ignored: set[str] = set()
        self._last_request: SceneRequest | None = None
        self._failure: Exception | None = None
        self._topic_publishers: dict[str, Any] = {}
        self._typed: dict[str, TypedTopic] = {}
        self._displays: dict[str, list[SceneDisplay]] = {}
        self._ready = self.create_publisher(Header, topics.READY, rclpy_qos(LATCHED))
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        self.create_wall_timer(1.0, self._publish_diagnostics)

    def close(self) -> None:
        """Release resources that must not stay open; called once, before the process ends."""

    def create_wall_timer(self, period_s: float, callback: Any) -> None:
        """Create a timer on the wall clock, which also runs while simulated time stands still."""
        self.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Let the executor call a function; other threads may ask for it."""
        if self.executor is not None:
            self.executor.create_task(self._call, callback)

    def _call(self, callback: Callable[[], None]) -> None:
        """Call a function; keep what it raises, as rclpy's events executor crashes if a task raises anything."""
        try:
            callback()
        except Exception as error:
            self._failure = error

    def raise_failure(self) -> None:
        """Raise what a function given to ``call_soon`` has raised."""
        if self._failure is not None:
            raise self._failure

    def declare_read_only(
        self, name: str, default: Any, description: str, *, minimum: float | None = None, allowed: str = ""
    ) -> Any:
        """Declare a read-only parameter and return its value, see ``ros.conventions.parameters``."""
        return declare_read_only(self, name, default, description, minimum=minimum, allowed=allowed)

    def declare_section(self, name: str, model: type[Section]) -> Section:
        """Declare a read-only parameter with a section of the configuration as JSON; return the validated section.

        Raises:
            InputError: The parameter is not JSON, or a value in it is not allowed.
        """
        words = f"The configuration's section {name}, as JSON; {{}}: all defaults"
        text = self.declare_read_only(name, "{}", words, allowed=f"as {name} in docs/reference/configuration.md")
        try:
            return model.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, (name, *first["loc"])))
            raise InputError(f"parameter {where}: {first['msg']}") from None

    def advertise(self, topic: Topic) -> None:
        """Create the publisher of a topic unless it exists, or its message package is not installed.

        Parameters may override the QoS of live sensor topics.
        """
        if topic.name not in self._topic_publishers and is_installed(topic.type):
            kind, qos = message_class(topic.type), rclpy_qos(self.offered_qos(topic))
            in_ros = ros_name(topic.name, self.graph_namespace)
            overrides = override_options(self, in_ros) if self.live and topic.sensor else None
            publisher = self.create_publisher(kind, topic.name, qos, qos_overriding_options=overrides)
            self._topic_publishers[topic.name] = publisher

    def offered_qos(self, topic: Topic) -> QosProfile:
        """QoS profile with which the graph publishes a topic."""
        return qos_of(topic, live=self.live, reliable=self.reliable)

    def publish_once(self, topic: Topic, make: Callable[..., bytes], *values: Any) -> None:
        """Make the message of a latched display and publish it, if its message package is installed."""
        if topic.name in self._topic_publishers:
            self.publish(topic.name, make(*values))

    def advertise_derived(self, spec: SceneSpec) -> None:
        """Create the publishers of typed messages and displays that are made of this node's topics."""
        own = {*self._topic_publishers}
        self._typed = {each.source.name: each for each in typed_topics(spec) if each.source.name in own}
        self._displays = {}
        for display in scene_displays(spec):
            if display.sources[0] in own:
                self._displays.setdefault(display.sources[0], []).append(display)
        displays = chain.from_iterable(self._displays.values())
        for topic in (*(each.topic for each in self._typed.values()), *(each.topic for each in displays)):
            self.advertise(topic)

    def displays_of(self, source: str) -> Sequence[SceneDisplay]:
        """Displays that this node makes of the messages on a topic, and advertises."""
        return [each for each in self._displays.get(source, ()) if each.topic.name in self._topic_publishers]

    def publish_typed_once(self, source: str, content: Any, stamp_ns: int) -> None:
        """Publish the content of a latched message as a typed message, which is latched as well."""
        if (typed := self._typed.get(source)) is not None:
            self.publish_once(typed.topic, typed.serialize, content, stamp_ns)

    def publish_derived(self, stamp_ns: int, contents: Mapping[str, Any]) -> None:
        """Publish the typed messages and displays that have subscribers and follow from contents of messages.

        Args:
            stamp_ns: The messages' stamp.
            contents: Table, image, record or poses in the message, by the topic's name.
        """
        for source, content in contents.items():
            typed = self._typed.get(source)
            if typed is not None and self._is_read(typed.topic):
                self.publish(typed.topic.name, typed.serialize(content, stamp_ns))
            for display in self._displays.get(source, ()):
                if self._is_read(display.topic) and all(each in contents for each in display.sources):
                    self.publish(
                        display.topic.name, display.make(stamp_ns, *(contents[each] for each in display.sources))
                    )

    def is_shown(self, source: str) -> bool:
        """Whether typed messages or displays that are made of the messages on a topic have subscribers."""
        typed = [self._typed[source].topic] if source in self._typed else []
        return any(map(self._is_read, (*typed, *(each.topic for each in self._displays.get(source, ())))))

    def _is_read(self, topic: Topic) -> bool:
        """Whether a topic is advertised and has subscribers."""
        return topic.name in self._topic_publishers and bool(self.reader_count(topic.name))

    def publish(self, name: str, message: Any) -> None:
        """Publish a message, as object or serialized, on an advertised topic."""
        with self.meter.part("send"):
            self._topic_publishers[name].publish(message)

    def reader_count(self, name: str) -> int:
        """Number of subscriptions that an advertised topic is connected to."""
        return int(self._topic_publishers[name].get_subscription_count())

    def report_finished(self, spec: SceneSpec, tick: int) -> None:
        """Report on /sync/ready that this node has finished a tick."""
        self._simulated_ns = spec.stamp_ns(tick)
        self._ready.publish(report_message(Report(self.node_name.name, spec.name, self._simulated_ns), self.signer))

    def follow_scenes(self, start: Callable[[str, bytes], None]) -> None:
        """Subscribe to scenes; ``start`` receives the JSON of each specification, and the serialized message.

        In a graph with a key these are the scenes that the supervisor has asked for, otherwise all that are announced.
        """

        def announce(payload: bytes) -> None:
            if (specification := self.read(topics.SCENE, _specification, payload)) is not None:
                inbox.announce(specification, payload)
                if not self.signer.checks:
                    inbox.request(specification)

        def request(message: String) -> None:
            if (asked := self.read_request(message)) is not None:
                inbox.request(asked.spec.model_dump_json())

        inbox = SceneInbox(start)
        self.create_subscription(String, topics.SCENE, announce, rclpy_qos(STEERING), raw=True)
        if self.signer.checks:
            self.create_subscription(String, topics.REQUEST, request, rclpy_qos(STEERING))

    def read_request(self, message: String) -> SceneRequest | None:
        """The supervisor's request in a message from /world/request; None if it has another sender or is old."""
        request = self.read(topics.REQUEST, content_of, SceneRequest, message.data, self.signer)
        last = self._last_request
        if request is None or (self.signer.checks and last is not None and request.number <= last.number):
            return None
        self._last_request = request
        return request

    def read_end(self, message: String) -> SceneEnd | None:
        """The world node's message from /world/end; None if it has another sender."""
        return self.read(topics.END, content_of, SceneEnd, message.data, self.signer)

    def read(
        self,
        topic: str,
        read: Callable[_Arguments, _Content],
        *arguments: _Arguments.args,
        **options: _Arguments.kwargs,
    ) -> _Content | None:
        """Read a message of unknown origin; None if it is malformed or forged.

        Such messages are counted in /diagnostics; the first one on each topic is logged.

        Args:
            topic: Its topic.
            read: Reads it.
            arguments: Arguments of ``read``.
            options: Further ones, by name.
        """
        try:
            return read(*arguments, **options)
        except MALFORMED as error:
            self.ignore(topic, error)
            return None

    def ignore(self, topic: str, reason: Exception) -> None:
        """Count a message that cannot be used; log the first one on a topic, and where it was found."""
        self.meter.count_ignored()
        if topic not in self._ignored:
            self._ignored.add(topic)
            words = " ".join(str(reason).split())[:_MAX_REASON_CHARACTERS]
            self.get_logger().warning(f"ignored messages on {topic}: {words}")
            if not isinstance(reason, SimbevError):
                for line in "".join(traceback.format_exception(reason)).splitlines():
                    self.get_logger().info(line)

    def _publish_diagnostics(self) -> None:
        load = self.meter.read()
        statuses = [load_status(self.node_name, load), frequency_status(self.node_name, load)]
        self._diagnostics.publish(DiagnosticArray(header=header(self._simulated_ns, ""), status=statuses))


def _specification(payload: bytes) -> str:
    """The JSON in a message from /world/scene; raises ValueError if it is not a specification."""
    text: str = deserialize_message(payload, String).data
    SceneSpec.from_json(text)
    return text
