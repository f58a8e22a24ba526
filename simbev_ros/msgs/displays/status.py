"""Records as diagnostic_msgs/DiagnosticArray, which Foxglove and Lichtblick list and PlotJuggler plots."""

from collections.abc import Iterator, Mapping
from typing import Any

from simbev_ros.msgs.displays.messages import DIAGNOSTICS, build, serialize, stamped


def status(name: str, record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """DiagnosticArray with one status, whose values are those of a record, nested ones with a dot in their key."""
    values = [build("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in _flat(record)]
    one = build("diagnostic_msgs/msg/DiagnosticStatus", name=name, message=str(record.get("type", "")), values=values)
    return serialize(build(DIAGNOSTICS, header=stamped(stamp_ns, ""), status=[one]))


def _flat(record: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in record.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, list | tuple):
            yield from _flat({str(number): each for number, each in enumerate(value)}, f"{prefix}{key}.")
        elif key != "stamp_ns":
            yield f"{prefix}{key}", str(value)
