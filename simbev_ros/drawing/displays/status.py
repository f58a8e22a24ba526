"""Records as diagnostic_msgs/DiagnosticArray, which Foxglove and Lichtblick list and PlotJuggler plots."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from simbev_ros.drawing.displays.messages import DIAGNOSTICS, build, serialize, stamped

WEATHER, EVENT, LANE = "weather", "event", "lane"
"""Names of the statuses."""


def status(name: str, record: Mapping[str, Any], stamp_ns: int) -> bytes:
    """DiagnosticArray with one status that has the values of a record, nested ones with a dot in their key.

    Values are written as in JSON, so that a record that was sent as JSON leads to the same message.
    """
    plain = json.loads(json.dumps(record))
    values = [build("diagnostic_msgs/msg/KeyValue", key=key, value=value) for key, value in _flat(plain)]
    one = build("diagnostic_msgs/msg/DiagnosticStatus", name=name, message=str(record.get("type", "")), values=values)
    return serialize(build(DIAGNOSTICS, header=stamped(stamp_ns, ""), status=[one]))


def _flat(record: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    for key, value in record.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, list):
            yield from _flat({str(number): each for number, each in enumerate(value)}, f"{prefix}{key}.")
        elif key != "stamp_ns":
            yield f"{prefix}{key}", value if isinstance(value, str) else json.dumps(value)
