"""The base class of all nodes of the graph: parameters with descriptors, reports of finished ticks, diagnostics."""

from typing import Any, TypeVar

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from pydantic import ValidationError
from rcl_interfaces.msg import ParameterDescriptor, ParameterType
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from std_msgs.msg import Header

from simbev_ros.config.base import Model
from simbev_ros.errors import InputError
from simbev_ros.msgs import topics
from simbev_ros.msgs.message_types import message_class
from simbev_ros.msgs.qos import LATCHED, qos_of, rclpy_qos
from simbev_ros.msgs.stamps import header
from simbev_ros.msgs.topic import Topic
from simbev_ros.nodes.load_meter import LoadMeter
from simbev_ros.scene.spec import SceneSpec

Section = TypeVar("Section", bound=Model)


class GraphNode(Node):
    """Base of every node of the graph.

    Attributes:
        takes_message_info: Whether it has callbacks that take message and message info, which rclpy's events executor
            cannot call.
        reuses_large_buffers: Whether it allocates and frees large arrays at each tick, so that its process had better
            keep freed memory.
    """

    takes_message_info = False
    reuses_large_buffers = False

    def __init__(self, name: str) -> None:
        use_sim_time = Parameter("use_sim_time", Parameter.Type.BOOL, True)
        super().__init__(name, parameter_overrides=[use_sim_time])
        self.live: bool = self.declare_read_only(
            "live", False, "Paced by the wall clock; sensor topics are best effort"
        )
        self.meter = LoadMeter()
        self._topic_publishers: dict[str, Any] = {}
        self._ready = self.create_publisher(Header, topics.READY, rclpy_qos(LATCHED))
        self._diagnostics = self.create_publisher(DiagnosticArray, topics.DIAGNOSTICS, 10)
        self.create_wall_timer(1.0, self._publish_diagnostics)

    def close(self) -> None:
        """Release resources that must not stay open; called once, before the process ends."""

    def create_wall_timer(self, period_s: float, callback: Any) -> None:
        """Create a timer on the wall clock, which also runs while simulated time stands still."""
        self.create_timer(period_s, callback, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def declare_read_only(self, name: str, default: Any, description: str) -> Any:
        """Declare a read-only parameter and return its value; the default ``[]`` means a list of strings."""
        descriptor = ParameterDescriptor(description=description, read_only=True)
        if default == []:
            descriptor.type = ParameterType.PARAMETER_STRING_ARRAY
            return list(self.declare_parameter(name, Parameter.Type.STRING_ARRAY, descriptor).value or [])
        return self.declare_parameter(name, default, descriptor).value

    def declare_section(self, name: str, model: type[Section]) -> Section:
        """Declare a read-only parameter with a section of the configuration as JSON; return the validated section.

        Raises:
            InputError: The parameter is no JSON, or a value in it is not allowed.
        """
        text = self.declare_read_only(name, "{}", f"The configuration's section {name}, as JSON; {{}}: all defaults")
        try:
            return model.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            where = ".".join(map(str, (name, *first["loc"])))
            raise InputError(f"parameter {where}: {first['msg']}") from None

    def advertise(self, topic: Topic) -> None:
        """Create the publisher of a topic unless it exists."""
        if topic.name not in self._topic_publishers:
            kind, qos = message_class(topic.type), rclpy_qos(qos_of(topic, live=self.live))
            self._topic_publishers[topic.name] = self.create_publisher(kind, topic.name, qos)

    def publish(self, name: str, message: Any) -> None:
        """Publish on an advertised topic."""
        self._topic_publishers[name].publish(message)

    def reader_count(self, name: str) -> int:
        """Number of subscriptions that an advertised topic is connected to."""
        return int(self._topic_publishers[name].get_subscription_count())

    def report_finished(self, spec: SceneSpec, tick: int) -> None:
        """Report on /sync/ready that this node has finished a tick."""
        self._ready.publish(header(spec.stamp_ns(tick), f"{self.get_name()}:{spec.name}"))

    def _publish_diagnostics(self) -> None:
        load = self.meter.read()
        status = DiagnosticStatus(
            level=DiagnosticStatus.WARN if load["dropped"] else DiagnosticStatus.OK,
            name=f"simbev: {self.get_name()}",
            message=f"{load['rate_hz']:.1f} Hz, {load['busy_ms']:.1f} ms a tick",
            hardware_id=self.get_name(),
            values=[KeyValue(key=key, value=f"{value:g}") for key, value in load.items()],
        )
        stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(DiagnosticArray(header=Header(stamp=stamp), status=[status]))
