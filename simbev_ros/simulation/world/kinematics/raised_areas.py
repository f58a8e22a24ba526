"""Areas that rise above the roads: sidewalks, and the land where people walk on it. In: a layout. Out: polygons."""

from functools import partial
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry.base import BaseGeometry

from simbev_ros.assets.placement.region_ground import LAND_HEIGHT_M
from simbev_ros.foundation.cache.entries import entry_path
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.foundation.geometry import overlay
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.lane_kind import CURB_HEIGHT_M
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.raised_lanes import RaisedLanes
from simbev_ros.maps.roads.surface import surfaces_of
from simbev_ros.scene.cached_method import cached_method

CELL_M = 512.0
"""Side of a cell of the grid."""
_KIND = "sidewalks"
_Areas = tuple[tuple[BaseGeometry, float], ...]


class RaisedAreas:
    """Sidewalks of a map, and the land beside streets if people walk on it; built on demand, cell by cell.

    They take longer to build than all else in the ground, so they are kept, and the scenes of a map share them.
    """

    def __init__(self, layout: Layout, walks_on_land: bool = False, folder: Path | None = None) -> None:
        """For a layout.

        Args:
            layout: The layout of the roads.
            walks_on_land: Whether people walk on the land beside the streets, as there are no sidewalks.
            folder: Folder of the cache for cells that have been built; None: they are not kept.
        """
        self._layout, self._walks_on_land, self._folder = layout, walks_on_land, folder

    @classmethod
    def of_map(cls, network: RoadNetwork) -> "RaisedAreas":
        """Those of a whole map, whose cells are kept in its cache. ``in_cell`` fails if that cannot be written."""
        root = network.net_path.parents[2] / _KIND  # the net is in <cache>/<maps>/<map>
        folder = entry_path(root, network.name, fingerprint(__name__), network.net_path.parent.name.encode())
        return cls(network.layout, not network.verges.is_empty, folder)

    @cached_method(maxsize=256)
    def in_cell(self, level: int, column: int, row: int) -> _Areas:
        """The areas of a level in a cell of the grid, prepared, with their heights above the carriageway's plane.

        Raises:
            InputError: The cache cannot be written.
        """
        build = partial(self._build, level, column, row)
        if self._folder is None:
            areas = build()
        else:
            path = self._folder / f"{level}_{column}_{row}.npz"
            areas = read_cached(path, _KIND, _read, lambda file: _write(file, build()))
        shapely.prepare([each for each, _ in areas])
        return areas

    def _build(self, level: int, column: int, row: int) -> _Areas:
        x_m, y_m = column * CELL_M, row * CELL_M
        area = shapely.box(x_m, y_m, x_m + CELL_M, y_m + CELL_M)
        streets = surfaces_of(self._layout, level, area)
        areas: list[tuple[BaseGeometry, float]] = [(streets.sidewalk, CURB_HEIGHT_M)]
        if self._walks_on_land and level == 0:
            taken = overlay.union_all([streets.road, streets.shoulder, streets.median, streets.sidewalk])
            areas.append((overlay.difference(area, taken), LAND_HEIGHT_M))
        if raised := self._raised_lanes(level):
            areas = [(overlay.difference(each, raised.area), high_m) for each, high_m in areas]
        return tuple(areas)

    @cached_method()
    def _raised_lanes(self, level: int) -> RaisedLanes:
        return RaisedLanes.of_level(self._layout, level)


def _write(path: Path, areas: _Areas) -> None:
    """Write areas as WKB, one after another, which keeps every bit of their coordinates."""
    content = [shapely.to_wkb(area) for area, _ in areas]
    np.savez(
        path,
        allow_pickle=False,
        wkb=np.frombuffer(b"".join(content), np.uint8),
        size=[len(each) for each in content],
        height_m=[height_m for _, height_m in areas],
    )


def _read(path: Path) -> _Areas:
    with np.load(path, allow_pickle=False) as arrays:
        ends = np.cumsum(arrays["size"])[:-1]
        parts = [part.tobytes() for part in np.split(arrays["wkb"], ends)]
        return tuple(zip(shapely.from_wkb(parts).tolist(), arrays["height_m"].tolist(), strict=True))
