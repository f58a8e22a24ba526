"""A node's statuses for /diagnostics, with names, values and levels as diagnostic_updater writes them.

Names are ``node: task``, by which analyzers of diagnostic_aggregator find them; ``config/diagnostics/analyzers.yaml``
has some. Whether a node has fallen silent is for the aggregator to find out, which then calls its statuses stale.
"""

from collections.abc import Mapping

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from simbev_ros.ros.conventions.names import NodeName
from simbev_ros.ros.nodes.load_meter import BUSY

LOAD, FREQUENCY = "load", "Frequency Status"
"""Tasks: what a node's ticks cost; and whether it keeps up, which diagnostic_updater calls so."""
TOLERANCE = 0.1
"""Fraction by which a rate may be too low without a warning, as in diagnostic_updater."""


def hardware_id(name: NodeName) -> str:
    """Subject of a node's statuses: its full name without the first slash."""
    return name.full.removeprefix("/")


def status(name: NodeName, task: str, level: bytes, message: str, values: Mapping[str, float]) -> DiagnosticStatus:
    """One status of a node.

    Args:
        name: The node.
        task: What it is about.
        level: A constant of DiagnosticStatus.
        message: The status in words.
        values: Numbers by name; names contain the units.
    """
    return DiagnosticStatus(
        level=level,
        name=f"{hardware_id(name)}: {task}",
        message=message,
        hardware_id=hardware_id(name),
        values=[KeyValue(key=key, value=f"{value:g}") for key, value in values.items()],
    )


def load_status(name: NodeName, load: Mapping[str, float]) -> DiagnosticStatus:
    """The cost of a node's ticks; a warning if it has ignored messages since the last report.

    Args:
        name: The node.
        load: A reading of its ``LoadMeter``.
    """
    words, level = f"{load[BUSY]:.1f} ms a tick", DiagnosticStatus.OK
    if load["ignored"]:
        words, level = f"{words}; {load['ignored']:g} messages ignored", DiagnosticStatus.WARN
    return status(name, LOAD, level, words, load)


def frequency_status(name: NodeName, load: Mapping[str, float]) -> DiagnosticStatus:
    """Whether a node keeps up with its due ticks; without any due tick, as in a pause, all is well.

    Args:
        name: The node.
        load: A reading of its ``LoadMeter``.
    """
    window_s, rate_hz = load["window_s"], load["rate_hz"]
    due_hz = (load["ticks"] + load["late"]) / window_s
    minimum_hz = due_hz * (1.0 - TOLERANCE)
    level, words = DiagnosticStatus.OK, "Desired frequency met" if due_hz else "No tick was due"
    if rate_hz < minimum_hz:
        level, words = DiagnosticStatus.WARN, f"Frequency too low: {load['late']:g} ticks late"
    values = {
        "Events in window": load["ticks"],
        "Events since startup": load["ticks_total"],
        "Duration of window (s)": window_s,
        "Actual frequency (Hz)": rate_hz,
        "Target frequency (Hz)": due_hz,
        "Minimum acceptable frequency (Hz)": minimum_hz,
    }
    return status(name, FREQUENCY, level, words, values)
