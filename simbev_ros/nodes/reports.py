"""Reports on /sync/ready: which node has finished which tick.

A report is a std_msgs/Header with the stamp of the tick and ``name:scene`` as frame id. Nodes of the graph add their
signature, ``name:scene:signature``; outside participants, whose names are configured, do not have to.
"""

from collections.abc import Collection
from typing import NamedTuple

from std_msgs.msg import Header

from simbev_ros.msgs.signing import Signer
from simbev_ros.msgs.stamps import header, stamp_of


class Report(NamedTuple):
    """A node has finished the tick with this stamp, ns, of a scene."""

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
        outside: Names of the nodes whose reports need no signature.

    Raises:
        ValueError: It is no report, or somebody else sends it in the name of one of the graph's nodes.
    """
    node, _, rest = message.frame_id.partition(":")
    scene, _, signature = rest.partition(":")
    report = Report(node, scene, stamp_of(message.stamp))
    if not scene:
        raise ValueError(f"frame_id is {message.frame_id!r}; it must be name:scene")
    if node not in outside and not signer.is_valid(signature, _text(report)):
        raise ValueError(f"{node!r} has not signed its report, and is not in graph.participants")
    return report


def _text(report: Report) -> str:
    return f"{report.node}:{report.scene}:{report.stamp_ns}"
