"""Traffic lights and signs of the vector map, each with the lanes that it applies to.

Positions on traffic lanes are matched with the layout's lane strips once per scene; ``TrafficGuides.records`` then
returns the lights and signs for the strips of a patch.
"""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from typing import Any

import numpy as np
import shapely

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.lane_links import strips_at
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Layout, Sign, SignKind
from simbev_ros.simulation.annotation.vector_map.patch import Patch, plain_points

_BEFORE_END_M = 0.5
_Record = dict[str, Any]


class TrafficGuides:
    """All lights and signs of a scene.

    Lights, stop and yield signs apply at the end of their lanes, speed limits where they stand.
    """

    def __init__(self, network: RoadNetwork, layout: Layout, driven: LaneStrips) -> None:
        """Prepare the lights of a network and the signs of a layout; their lanes have strips in ``driven``."""
        lights = [(signal.position_m, signal.yaw_rad) for signal in network.signals]
        light_positions = [
            [(network.lanes[signal.lane], _end_m(network.lanes[signal.lane]))] for signal in network.signals
        ]
        self._lights = _Guides(
            [{"id": number + 1} for number in range(len(lights))], lights, list(_strips_at(light_positions, driven))
        )
        sign_positions = [list(_sign_positions(sign, network)) for sign in layout.signs]
        self._signs = _Guides(
            [
                {"id": number, "kind": sign.kind.value, "speed_mps": round(sign.speed_mps, 3)}
                for number, sign in enumerate(layout.signs)
            ],
            [(sign.foot_m, sign.yaw_rad) for sign in layout.signs],
            list(_strips_at(sign_positions, driven)),
        )

    def records(self, strips: Collection[str], patch: Patch) -> _Record:
        """Records ``traffic_lights`` and ``signs`` for the given strips, in order."""
        return {"traffic_lights": self._lights.records(strips, patch), "signs": self._signs.records(strips, patch)}


class _Guides:
    """Lights or signs: their attributes, (3,) positions with yaws, and the ids of the strips that they apply to."""

    def __init__(
        self, facts: list[_Record], poses: list[tuple[Float64Array, float]], strips: list[tuple[str, ...]]
    ) -> None:
        self._facts, self._poses, self._strips = facts, poses, strips
        self._of_strip: dict[str, list[int]] = defaultdict(list)
        for index, names in enumerate(strips):
            for name in names:
                self._of_strip[name].append(index)

    def records(self, strips: Collection[str], patch: Patch) -> list[_Record]:
        """Records of those that apply to any of the strips."""
        return [
            {
                **self._facts[index],
                "position": plain_points(patch.from_map(self._poses[index][0][None]))[0],
                "yaw": round(float(np.angle(np.exp(1j * (self._poses[index][1] - patch.yaw_rad)))), 4),
                "lanes": list(self._strips[index]),
            }
            for index in sorted({index for strip in strips for index in self._of_strip.get(strip, ())})
        ]


def _strips_at(positions: Iterable[list[tuple[Lane, float]]], driven: LaneStrips) -> Iterator[tuple[str, ...]]:
    """For each list of positions on traffic lanes, the distinct strips there."""
    groups = list(positions)
    names = iter(strips_at([position for positions in groups for position in positions], driven))
    for group in groups:
        unique_names = dict.fromkeys(next(names) for _ in group)
        yield tuple(name for name in unique_names if name)


def _sign_positions(sign: Sign, network: RoadNetwork) -> Iterator[tuple[Lane, float]]:
    """Positions on its lanes where a sign applies, or begins to."""
    for lane in (network.lanes[name] for name in sign.lanes):
        if sign.kind is SignKind.SPEED_LIMIT:
            line = shapely.LineString(lane.centerline_m[:, :2])
            yield lane, float(shapely.line_locate_point(line, shapely.Point(sign.foot_m[:2])))
        else:
            yield lane, _end_m(lane)


def _end_m(lane: Lane) -> float:
    """Position shortly before the end of a lane, measured from its start."""
    return max(lane.length_m - _BEFORE_END_M, 0.0)
