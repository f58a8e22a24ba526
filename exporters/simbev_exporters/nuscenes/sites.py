"""Sites: the rectangles of maps in which the scenes of an export take place.

Summaries of scenes enter; ``Site``s leave. A site's lower left corner is the origin of nuScenes' global frame, in which
coordinates cannot be negative. A site therefore covers the surroundings of the ego's paths in all scenes on its map,
and all positions are relative to its corner. Where the mask of that would be too large, each scene has its own site.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from simbev_exporters.nuscenes.taxonomy import Record, token
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.stored import read_stored

PIXELS_PER_M = 10

_MARGIN_M = 150.0
_STEP_M = 10.0
_MAX_AREA_M2 = 5e6


@dataclass(frozen=True, slots=True)
class Site:
    """A rectangle of a map in which some scenes take place, and which has one mask.

    Attributes:
        map: The map.
        bag: Path of the bag of one of the scenes.
        scenes: Names of all its scenes.
        low_m: Lower left corner, map frame, whole numbers.
        high_m: Upper right corner, map frame, whole numbers.
        name: Name of the map, followed by the name of the scene if the site is of one scene only.
        has_roads: Whether the mask shows roads; without the simulator it is empty.
    """

    map: MapSpec
    bag: str
    scenes: tuple[str, ...]
    low_m: tuple[float, float]
    high_m: tuple[float, float]
    name: str
    has_roads: bool

    @classmethod
    def around(cls, summaries: Iterable[Mapping[str, Any]], name: str, *, has_roads: bool = True) -> Self:
        """The site around the ego's paths in scenes on one map, given their summaries."""
        summaries = list(summaries)
        low_m = np.min([each["low_m"] for each in summaries], axis=0) - _MARGIN_M
        high_m = np.max([each["high_m"] for each in summaries], axis=0) + _MARGIN_M
        low_m, high_m = np.floor(low_m / _STEP_M) * _STEP_M, np.ceil(high_m / _STEP_M) * _STEP_M
        return cls(
            read_stored(MapSpec, summaries[0]["map"]),
            summaries[0]["bag"],
            tuple(each["name"] for each in summaries),
            (float(low_m[0]), float(low_m[1])),
            (float(high_m[0]), float(high_m[1])),
            name,
            has_roads,
        )

    @property
    def token(self) -> str:
        """Token of the mask, different for each map and extent."""
        empty = () if self.has_roads else ("empty",)
        return token("map", self.map.name, self.map.seed, self.map.sha256, self.low_m, self.high_m, *empty)

    @property
    def filename(self) -> str:
        """Path of the mask, relative to the export's folder."""
        return f"maps/{self.token}.png"

    @property
    def size_px(self) -> tuple[int, int]:
        """Width and height of the mask."""
        width_px, height_px = np.rint(np.subtract(self.high_m, self.low_m) * PIXELS_PER_M).astype(int).tolist()
        return width_px, height_px

    @property
    def area_m2(self) -> float:
        """Area of the mask."""
        return (self.high_m[0] - self.low_m[0]) * (self.high_m[1] - self.low_m[1])

    def record(self, logs: Iterable[str]) -> Record:
        """Row of the table ``map``; ``origin_m`` is our addition: the global frame's origin in the map frame."""
        kind = {"token": self.token, "category": "semantic_prior", "filename": self.filename}
        return {**kind, "log_tokens": sorted(logs), "origin_m": list(self.low_m)}


def sites_of(summaries: Iterable[Mapping[str, Any]], *, has_roads: bool = True) -> list[Site]:
    """The sites of scenes, given their summaries; each scene belongs to exactly one site."""
    by_map: defaultdict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for summary in summaries:
        by_map[_location(read_stored(MapSpec, summary["map"]))].append(summary)
    sites = []
    for name, known in sorted(by_map.items()):
        whole = Site.around(known, name, has_roads=has_roads)
        if whole.area_m2 <= _MAX_AREA_M2:
            sites.append(whole)
        else:
            sites += [Site.around([each], f"{name} {each['name']}", has_roads=has_roads) for each in known]
    return sites


def _location(spec: MapSpec) -> str:
    """A unique name of a map."""
    seed, content = (f"-{spec.seed}" if spec.seed else ""), (f"-{spec.sha256[:8]}" if spec.path else "")
    return f"{spec.name}{seed}{content}"
