"""Converts traffic lights to Autoware's groups, whose ids are those of regulatory elements in a Lanelet2 file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from autoware_perception_msgs.msg import TrafficLightElement, TrafficLightGroup, TrafficLightGroupArray
from builtin_interfaces.msg import Time

from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.maps.findings import Findings
from simbev_ros.maps.lanelet2.reader import read_lanelet_map
from simbev_ros.schema.scene.state import SignalState

_SAME_HEAD_M = 0.3
_SHOWN = {
    SignalState.RED: (TrafficLightElement.RED,),
    SignalState.YELLOW: (TrafficLightElement.AMBER,),
    SignalState.GREEN: (TrafficLightElement.GREEN,),
    SignalState.RED_YELLOW: (TrafficLightElement.RED, TrafficLightElement.AMBER),
}


def read_light_groups(path: Path) -> dict[int, Float64Array]:
    """Id of each traffic light element of a Lanelet2 file → (K, 2) positions of its lights, map frame.

    Raises:
        InputError: The file is not OSM XML, or has no usable positions.
    """
    content, _ = read_lanelet_map(path, Findings(path))
    return {
        int(name): np.array([line.points_m[[0, -1], :2].mean(axis=0) for line in rule.lines.get("refers", ())])
        for name, rule in content.regulations.items()
        if rule.subtype == "traffic_light" and rule.lines.get("refers") and name.lstrip("-").isdigit()
    }


def rows_of_groups(groups: Mapping[int, Float64Array], signals: Table) -> dict[int, list[int]]:
    """Group → the rows of (S,) ``SIGNAL_DTYPE`` that are its lights; groups without a light of ours are left out."""
    if not len(signals):
        return {}
    heads_m = np.stack([signals["x"], signals["y"]], axis=1)
    found = {}
    for name, lights_m in groups.items():
        distances_m = np.linalg.norm(heads_m[None] - lights_m[:, None], axis=2)
        rows = distances_m.argmin(axis=1)[distances_m.min(axis=1) < _SAME_HEAD_M]
        if len(rows):
            found[name] = sorted(set(rows.tolist()))
    return found


def lights_message(rows: Mapping[int, list[int]], signals: Table, stamp: Time) -> TrafficLightGroupArray:
    """The state of each group. Where its lights differ, or are off, it is unknown.

    Args:
        rows: Group → rows of its lights.
        signals: (S,) ``SIGNAL_DTYPE``.
        stamp: Time of the state.
    """
    message, lamp = TrafficLightGroupArray(stamp=stamp), TrafficLightElement
    for name, members in rows.items():
        states = {int(signals["state"][row]) for row in members}
        colors = _SHOWN.get(SignalState(states.pop()), ()) if len(states) == 1 else ()
        lit = [lamp(color=color, shape=lamp.CIRCLE, status=lamp.SOLID_ON, confidence=1.0) for color in colors]
        elements = lit or [lamp(confidence=1.0)]
        message.traffic_light_groups.append(TrafficLightGroup(traffic_light_group_id=name, elements=elements))
    return message
