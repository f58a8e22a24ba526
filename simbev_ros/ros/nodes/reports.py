"""Reports on /sync/ready: which node has finished which tick.

A report is a std_msgs/Header with the stamp of the tick and ``name:scene`` as frame id. Nodes of the graph add their
signature, ``name:scene:signature``. Outside participants, which have configured names, need not, and may leave out
the scene, too.
"""

from collections.abc import Callable, Collection
from typing import NamedTuple

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from std_msgs.msg import Header

from simbev_ros.ros.msgs import topics
from simbev_ros.ros.msgs.qos import STEERING, STEERING_VOLATILE, rclpy_qos
from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.msgs.stamps import header, stamp_of


class Report(NamedTuple):
    """A node has finished the tick with this stamp, ns, of a scene; an empty name stands for the scene of the stamp."""

    node: str
    scene: str
    stamp_ns: int


def report_message(report: Report, signer: Signer) -> Header:
    """The message of a report, signed if the signer has a key."""
    words = [report.node, report.scene, *([signer.sign(_text(report))] if signer.checks else [])]
    return header(report.stamp_ns, ":".join(words))


def read_report(message: Header, signer: Signer, outside: Collection[str]) -> Report:
    """The report in a message.

    Args:
        message: The message.
        signer: Checks the signature.
        outside: Names of the nodes that need not sign their reports.

    Raises:
        ValueError: It is not a report, or another sender uses the name of one of the graph's nodes.
    """
    node, _, rest = message.frame_id.partition(":")
    scene, _, signature = rest.partition(":")
    report = Report(node, scene, stamp_of(message.stamp))
    if node in outside:
        return report
    if not scene:
        raise ValueError(f"frame_id is {message.frame_id!r}; it must be name:scene")
    if not signer.is_valid(signature, _text(report)):
        raise ValueError(f"{node!r} has not signed its report, and is not in graph.participants")
    return report


def is_signed(frame_id: str) -> bool:
    """Whether the frame id of a report has a signature, valid or not, as those of a graph's own nodes have."""
    return frame_id.count(":") > 1


def subscribe_to_reports(node: Node, receive: Callable[[Header], None], outside: Collection[str]) -> None:
    """Subscribe to the reports of the graph's nodes and of outside participants, whatever durability these offer.

    A latched subscription receives what was reported before it existed, but is not compatible with volatile publishers,
    rclpy's default. A volatile one is compatible with both. So there are two if outside nodes take part. Reports
    of outside participants with latched publishers then arrive twice, which changes nothing.

    Args:
        node: The node that subscribes.
        receive: Called with each message.
        outside: Names of the outside participants.
    """
    if not outside:
        node.create_subscription(Header, topics.READY, receive, rclpy_qos(STEERING))
        return

    def receive_from_outside(message: Header) -> None:
        if not is_signed(message.frame_id):  # the graph's own reports have arrived by the other subscription
            receive(message)

    # rclpy's own warning would be wrong about a publisher that the other subscription is compatible with.
    silent = SubscriptionEventCallbacks(use_default_callbacks=False)
    node.create_subscription(Header, topics.READY, receive, rclpy_qos(STEERING), event_callbacks=silent)
    node.create_subscription(
        Header, topics.READY, receive_from_outside, rclpy_qos(STEERING_VOLATILE), event_callbacks=silent
    )


def _text(report: Report) -> str:
    return f"{report.node}:{report.scene}:{report.stamp_ns}"
