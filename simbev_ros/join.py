"""Lets a Python node join a graph's lockstep, so that the world waits until the node has finished each tick.

It needs rclpy and std_msgs, and nothing else of simbev_ros: copy this file to where your stack runs, if you like.

Example:
    >>> rclpy.init()
    >>> node = rclpy.create_node("perception")
    >>> with Lockstep(node, "my_stack") as lockstep:
    ...     def on_cloud(cloud):
    ...         detect(cloud)
    ...         lockstep.finished(cloud.header.stamp)
    ...     node.create_subscription(PointCloud2, "/ego/lidar/points", on_cloud, 64)
    ...     rclpy.spin(node)
"""

from __future__ import annotations

import json
import time
from functools import partial
from typing import TYPE_CHECKING, Any

from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Header, String

if TYPE_CHECKING:
    from collections.abc import Callable

    from builtin_interfaces.msg import Time
    from rclpy.node import Node

_NS_PER_S = 1_000_000_000
_HOUR_NS = 3600 * _NS_PER_S
"""Every scene has an hour of simulated time of its own: scene 0 the second one, scene 1 the third."""
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_POLL_S, _REPEAT_S = 0.1, 1.0
_POLLS_TO_SETTLE = 3
"""This side of a connection is established a moment before the other side is."""
_CONNECTION_PATIENCE_S = 5.0
_LAST_REPORT_PATIENCE_S = 1.0


class Lockstep:
    """Reports to the world which scenes a node has loaded and which ticks it has finished.

    Each scene is reported as loaded when ``load`` has returned and something publishes to every subscription of the
    node; what nobody publishes within 5 s is not waited for again. This report is repeated every second until the first
    input is finished, so it cannot get lost. As a context manager, it leaves on exit.

    Args:
        node: The node that receives the inputs. Something has to spin it.
        name: Name of the participant, as in ``graph.participants`` of the configuration.
        load: Called with each new scene, which is the JSON object of /world/scene, before it is reported as loaded.
        period_ticks: Number of ticks from one input to the next: 2 for a sensor at 10 Hz and ticks of 50 ms.
        namespace: Namespace of the graph, such as ``/sim1``, if it has one.

    Attributes:
        scene: The scene that plays, as given to ``load``; None: there has been none yet.
        period_ticks: As above; ``load`` may set it for each scene.
        outputs: Publishers of the node that need a subscriber before a scene is reported as loaded.
        optional: Topics of subscriptions that need no publisher before that.
    """

    def __init__(
        self,
        node: Node,
        name: str,
        *,
        load: Callable[[dict[str, Any]], object] | None = None,
        period_ticks: int = 1,
        namespace: str = "",
    ) -> None:
        self.scene: dict[str, Any] | None = None
        self.period_ticks = period_ticks
        self.outputs: list[Any] = []
        self.optional: set[str] = set()
        self._node, self._name, self._load = node, name, load
        self._polls_connected = 0
        self._announced_s = self._reported_s = 0.0
        self._is_awaited = False
        self._passed_over: set[str] = set()
        # Each listener has two subscriptions, of which one is for latched publishers: rclpy would warn of that one.
        silent = PublisherEventCallbacks(use_default_callbacks=False)
        self._ready = node.create_publisher(Header, f"{namespace}/sync/ready", 10, event_callbacks=silent)
        self._scenes = node.create_subscription(String, f"{namespace}/world/scene", self._on_scene, _LATCHED)
        self._timer = node.create_timer(_POLL_S, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def __enter__(self) -> Lockstep:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def finished(self, stamp: Time) -> None:
        """Report that the input with this stamp, and all before it, have been processed.

        Stamps of other scenes are ignored: an input may still arrive when the next scene has been announced.

        Args:
            stamp: ``header.stamp`` of the input.
        """
        stamp_ns = stamp.sec * _NS_PER_S + stamp.nanosec
        if self.scene is None or stamp_ns // _HOUR_NS != self.scene["number"] + 1:
            return
        self._is_awaited = False
        self._report(self.scene, stamp_ns + (self.period_ticks - 1) * self.scene["tick_ns"])

    def close(self) -> None:
        """Leave, when the last report has arrived. The world does not wait any longer only if the scene has ended."""
        if self._node.context.ok():
            self._ready.wait_for_all_acked(Duration(seconds=_LAST_REPORT_PATIENCE_S))
        self._node.destroy_timer(self._timer)
        self._node.destroy_subscription(self._scenes)
        self._node.destroy_publisher(self._ready)

    def _on_scene(self, message: String) -> None:
        try:
            scene = json.loads(message.data)
            _ = _name_of(scene), f"{scene['tick_ns']:d}"
        except (ValueError, LookupError, TypeError, RecursionError) as error:  # any process can send messages
            self._node.get_logger().warning(f"ignored a malformed message on /world/scene: {error!r:.200}")
            return
        self.scene = None  # while it loads, no tick of it can be finished
        if self._load is not None:
            self._load(scene)
        self.scene = scene
        self._announced_s, self._reported_s, self._is_awaited = time.monotonic(), 0.0, True

    def _poll(self) -> None:
        """Report the scene as loaded, again and again, once everything is connected; called by a timer."""
        unconnected = {each.topic_name for each in self._node.subscriptions if not each.get_publisher_count()}
        unconnected |= {each.topic_name for each in self.outputs if not each.get_subscription_count()}
        unconnected -= self._passed_over | self.optional
        self._polls_connected = 0 if unconnected else self._polls_connected + 1
        now_s = time.monotonic()
        if self.scene is None or not self._is_awaited or now_s < self._reported_s + _REPEAT_S:
            return
        if unconnected and now_s > self._announced_s + _CONNECTION_PATIENCE_S:
            self._passed_over |= unconnected
            self._node.get_logger().warning(f"nothing publishes {', '.join(sorted(unconnected))}; not waiting for it")
        if self._polls_connected >= _POLLS_TO_SETTLE:
            self._reported_s = now_s
            self._report(self.scene, stamp_ns=0)

    def _report(self, scene: dict[str, Any], stamp_ns: int) -> None:
        message = Header(frame_id=f"{self._name}:{_name_of(scene)}")
        message.stamp.sec, message.stamp.nanosec = divmod(stamp_ns, _NS_PER_S)
        self._ready.publish(message)


def _name_of(scene: dict[str, Any]) -> str:
    """Name of a scene, as the graph has it."""
    return f"{scene['map']['name']}-{scene['number']:04d}"


class Driver:
    """Drives a vehicle in lockstep: for each set of inputs with one stamp, it publishes one command with this stamp.

    The world applies the command ``graph.window_ticks`` ticks later, the same on every machine. Inputs that come less
    often are waited for when they are due, and held in between; their own stamps tell their ages.

    Args:
        node: The node; something has to spin it.
        decide: Called with the inputs by topic, and the scene; returns a command, of which the header is filled in.
        inputs: Message types by topics, all of them with a header and with the same stamps.
        command: Topic and type of the command, such as ``/ego/ackermann_cmd`` and ``AckermannDriveStamped``.
        period_ticks: Number of ticks from one set of inputs to the next.
        load: As for ``Lockstep``; it may set ``periods``.
        periods: Number of ticks from one message to the next of the topics that come less often than the others.

    Example:
        >>> def decide(inputs, scene):
        ...     command = AckermannDriveStamped()
        ...     command.drive.speed = 8.0
        ...     return command
        >>> rclpy.init()
        >>> node = rclpy.create_node("driver")
        >>> Driver(node, decide, {"/ego/odom": Odometry}, ("/ego/ackermann_cmd", AckermannDriveStamped))
        >>> rclpy.spin(node)
    """

    def __init__(
        self,
        node: Node,
        decide: Callable[[dict[str, Any], dict[str, Any]], Any],
        inputs: dict[str, Any],
        command: tuple[str, Any],
        *,
        period_ticks: int = 1,
        namespace: str = "",
        load: Callable[[dict[str, Any]], object] | None = None,
        periods: dict[str, int] | None = None,
    ) -> None:
        topic, kind = command
        agent = topic.removeprefix(namespace).split("/")[1]
        self.periods = periods or {}
        self._decide, self._inputs, self._load = decide, inputs, load
        self._waiting, self._held = dict[int, dict[str, Any]](), dict[str, tuple[int, Any]]()
        self._commands = node.create_publisher(kind, topic, 100)
        self.lockstep = Lockstep(
            node, f"{agent}_driver", load=self._start, period_ticks=period_ticks, namespace=namespace
        )
        self.lockstep.outputs.append(self._commands)
        for name, each in inputs.items():
            node.create_subscription(each, name, partial(self._receive, name), 100)

    def _start(self, scene: dict[str, Any]) -> None:
        self._waiting, self._held = {}, {}
        if self._load is not None:
            self._load(scene)

    def _receive(self, name: str, message: Any) -> None:
        stamp = message.header.stamp
        self._waiting.setdefault(stamp.sec * _NS_PER_S + stamp.nanosec, {})[name] = message
        if (scene := self.lockstep.scene) is None:
            return
        for stamp_ns in sorted(self._waiting):
            held = {
                name: each
                for name, (at_ns, each) in self._held.items()
                if stamp_ns < at_ns + self.periods[name] * scene["tick_ns"]
            }
            inputs = held | self._waiting[stamp_ns]
            if len(inputs) == len(self._inputs):
                self._held |= {name: (stamp_ns, inputs[name]) for name in self.periods if name not in held}
                self._waiting = {at_ns: each for at_ns, each in self._waiting.items() if at_ns > stamp_ns}
                self._command(self._decide(inputs, scene), stamp_ns, scene["tick_ns"])

    def _command(self, command: Any, stamp_ns: int, tick_ns: int) -> None:
        """Publish a command for each tick of a period, as the world waits for one; report the inputs as finished."""
        stamp = command.header.stamp
        for tick in range(self.lockstep.period_ticks):
            stamp.sec, stamp.nanosec = divmod(stamp_ns + tick * tick_ns, _NS_PER_S)
            self._commands.publish(command)
        stamp.sec, stamp.nanosec = divmod(stamp_ns, _NS_PER_S)
        self.lockstep.finished(stamp)
