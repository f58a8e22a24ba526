"""The traffic lights and signs that are for some lanes."""

from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator
from typing import Any

import numpy as np
import shapely

from simbev_ros.annotation.vector_map.patch import Patch, plain_points
from simbev_ros.maps.lane_links import strips_at
from simbev_ros.maps.network import Lane, RoadNetwork
from simbev_ros.maps.roads.lane_strips import LaneStrips
from simbev_ros.maps.roads.layout import Layout, Sign, SignKind
from simbev_ros.types import Float64Array

_BEFORE_END_M = 0.5
_Record = dict[str, Any]


class TrafficGuides:
    """All of a scene. A light, a stop or yield sign is for the end of its lanes, a speed limit for where it stands."""

    def __init__(self, network: RoadNetwork, layout: Layout, driven: LaneStrips) -> None:
        """Of a network the lights, of a layout the signs, whose lanes have strips among ``driven``."""
        lights = [(signal.position_m, signal.yaw_rad) for signal in network.signals]
        held = [[(network.lanes[signal.lane], _end_m(network.lanes[signal.lane]))] for signal in network.signals]
        self._lights = _Guides(
            [{"id": number + 1} for number in range(len(lights))], lights, list(_strips(held, driven))
        )
        told = [list(_told(sign, network)) for sign in layout.signs]
        self._signs = _Guides(
            [
                {"id": number, "kind": sign.kind.value, "speed_mps": round(sign.speed_mps, 3)}
                for number, sign in enumerate(layout.signs)
            ],
            [(sign.foot_m, sign.yaw_rad) for sign in layout.signs],
            list(_strips(told, driven)),
        )

    def of(self, strips: Collection[str], patch: Patch) -> _Record:
        """Those that are for strips: records for ``traffic_lights`` and ``signs``, in order."""
        return {"traffic_lights": self._lights.of(strips, patch), "signs": self._signs.of(strips, patch)}


class _Guides:
    """Lights or signs: their facts, (3,) positions with yaws, and the ids of the strips that they are for."""

    def __init__(
        self, facts: list[_Record], poses: list[tuple[Float64Array, float]], strips: list[tuple[str, ...]]
    ) -> None:
        self._facts, self._poses, self._strips = facts, poses, strips
        self._of_strip: dict[str, list[int]] = defaultdict(list)
        for number, names in enumerate(strips):
            for name in names:
                self._of_strip[name].append(number)

    def of(self, strips: Collection[str], patch: Patch) -> list[_Record]:
        """Records of those for any of some strips."""
        return [
            {
                **self._facts[number],
                "position": plain_points(patch.from_map(self._poses[number][0][None]))[0],
                "yaw": round(float(np.angle(np.exp(1j * (self._poses[number][1] - patch.yaw_rad)))), 4),
                "lanes": list(self._strips[number]),
            }
            for number in sorted({number for strip in strips for number in self._of_strip.get(strip, ())})
        ]


def _strips(places: Iterable[list[tuple[Lane, float]]], driven: LaneStrips) -> Iterator[tuple[str, ...]]:
    """For each list of places on lanes of the traffic the strips there, each once."""
    several = list(places)
    names = iter(strips_at([place for places in several for place in places], driven))
    for each in several:
        found = dict.fromkeys(next(names) for _ in each)
        yield tuple(name for name in found if name)


def _told(sign: Sign, network: RoadNetwork) -> Iterator[tuple[Lane, float]]:
    """Where on its lanes a sign holds, or begins to."""
    for lane in (network.lanes[name] for name in sign.lanes):
        if sign.kind is SignKind.SPEED_LIMIT:
            line = shapely.LineString(lane.centerline_m[:, :2])
            yield lane, float(shapely.line_locate_point(line, shapely.Point(sign.foot_m[:2])))
        else:
            yield lane, _end_m(lane)


def _end_m(lane: Lane) -> float:
    """A place shortly before a lane's end, from its start."""
    return max(lane.length_m - _BEFORE_END_M, 0.0)
