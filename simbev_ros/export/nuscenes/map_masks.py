"""Draws the masks of maps that nuScenes' devkit reads: white on streets and sidewalks, 0.1 m per pixel.

Summaries of scenes enter; ``Site``s and their PNG files leave. A mask's lower left corner is the origin of nuScenes'
global frame, in which coordinates cannot be negative. A mask therefore covers the surroundings of the ego's paths in
all scenes on its map, and all positions are relative to its corner. Where that picture would be too large, each scene
has its own mask.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import cv2
import numpy as np
import shapely

from simbev_ros.export.nuscenes.taxonomy import Record, token
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.replay.replay import build_recorded_roads

PIXELS_PER_M = 10
_MARGIN_M = 150.0
_STEP_M = 10.0
_MAX_AREA_M2 = 5e6
_WHITE = 255
_FRACTION_BITS = 4


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
    """

    map: MapSpec
    bag: str
    scenes: tuple[str, ...]
    low_m: tuple[float, float]
    high_m: tuple[float, float]
    name: str

    @classmethod
    def around(cls, summaries: Iterable[Mapping[str, Any]], name: str) -> Self:
        """The site around the ego's paths in scenes on one map, given their summaries."""
        summaries = list(summaries)
        low_m = np.min([each["low_m"] for each in summaries], axis=0) - _MARGIN_M
        high_m = np.max([each["high_m"] for each in summaries], axis=0) + _MARGIN_M
        low_m, high_m = np.floor(low_m / _STEP_M) * _STEP_M, np.ceil(high_m / _STEP_M) * _STEP_M
        return cls(
            MapSpec.model_validate(summaries[0]["map"]),
            summaries[0]["bag"],
            tuple(each["name"] for each in summaries),
            (float(low_m[0]), float(low_m[1])),
            (float(high_m[0]), float(high_m[1])),
            name,
        )

    @property
    def token(self) -> str:
        """Token of the mask, different for each map and extent."""
        return token("map", self.map.name, self.map.seed, self.map.sha256, self.low_m, self.high_m)

    @property
    def filename(self) -> str:
        """Path of the mask, relative to the export's folder."""
        return f"maps/{self.token}.png"

    @property
    def area_m2(self) -> float:
        """Area of the mask."""
        return (self.high_m[0] - self.low_m[0]) * (self.high_m[1] - self.low_m[1])

    def record(self, logs: Iterable[str]) -> Record:
        """Row of the table ``map``; ``origin_m`` is our addition: the global frame's origin in the map frame."""
        kind = {"token": self.token, "category": "semantic_prior", "filename": self.filename}
        return {**kind, "log_tokens": sorted(logs), "origin_m": list(self.low_m)}


def sites_of(summaries: Iterable[Mapping[str, Any]]) -> list[Site]:
    """The sites of scenes, given their summaries; each scene belongs to exactly one site."""
    by_map: defaultdict[str, list[Mapping[str, Any]]] = defaultdict(list)
    for summary in summaries:
        by_map[_location(MapSpec.model_validate(summary["map"]))].append(summary)
    sites = []
    for name, known in sorted(by_map.items()):
        whole = Site.around(known, name)
        if whole.area_m2 <= _MAX_AREA_M2:
            sites.append(whole)
        else:
            sites += [Site.around([each], f"{name} {each['name']}") for each in known]
    return sites


def _location(spec: MapSpec) -> str:
    """A unique name of a map."""
    seed, content = (f"-{spec.seed}" if spec.seed else ""), (f"-{spec.sha256[:8]}" if spec.path else "")
    return f"{spec.name}{seed}{content}"


def write_mask(site: Site, out: Path) -> None:
    """Draw and write the mask of a site, unless its file exists.

    Raises:
        InputError: The map's roads cannot be built.
    """
    path = out / site.filename
    if path.exists():
        return
    _, data = cv2.imencode(".png", draw_mask(network_of(site), site))
    write_whole(path, data.tobytes())


def network_of(site: Site) -> RoadNetwork:
    """The road network of a site.

    Raises:
        InputError: The map's roads cannot be built.
    """
    with SceneBag(Path(site.bag)) as bag:
        chosen = build_recorded_roads(bag)
    return load_network(chosen)


def draw_mask(network: RoadNetwork, site: Site) -> UInt8Array:
    """Mask of a site: (H, W) uint8, 255 on roads, shoulders and sidewalks of all levels; row 0 is in the north.

    Column c is at ``low_m[0] + 0.1 c``, row r at ``low_m[1] + 0.1 (H - r)``, as the devkit looks positions up.
    """
    size_m = np.subtract(site.high_m, site.low_m)
    width_px, height_px = np.rint(size_m * PIXELS_PER_M).astype(int).tolist()
    mask = np.zeros((height_px, width_px), np.uint8)
    for level in network.layout.levels:
        surfaces = surfaces_of(network.layout, level, shapely.box(*site.low_m, *site.high_m))
        for surface in (surfaces.road, surfaces.shoulder, surfaces.sidewalk):
            for polygon in surface.geoms:
                _fill_polygon(mask, polygon, site)
    return mask


def _fill_polygon(mask: UInt8Array, polygon: shapely.Polygon, site: Site) -> None:
    rings = []
    for ring in (polygon.exterior, *polygon.interiors):
        corners_px = (np.array(ring.coords)[:, :2] - site.low_m) * PIXELS_PER_M
        corners_px[:, 1] = len(mask) - corners_px[:, 1]
        rings.append(np.rint(corners_px * 2**_FRACTION_BITS).astype(np.int32))
    cv2.fillPoly(mask, rings, _WHITE, cv2.LINE_8, _FRACTION_BITS)
