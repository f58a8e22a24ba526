"""Builds the roads and surroundings of a map for ``simbev map``, times that, and writes the pictures."""

import math
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.markup import escape

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import StaticCache, load_static_scene
from simbev_ros.cli.map.report import MapReport, Surroundings
from simbev_ros.cli.production_display import MapDisplay
from simbev_ros.export.maps.conversion import is_point_map, write_map
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.maps.statistics import busiest_position, statistics_of
from simbev_ros.production.surroundings import build_missing_regions
from simbev_ros.schema.scene.map_spec import MapSpec

_REACH_M = 400.0
"""Radius around a place in which its surroundings are built; those of small maps are built completely."""
_FEW_REGIONS = 9
_VIEW_WITHIN_M = 260.0


def build_roads(spec: MapSpec, cache_dir: Path, console: Console) -> tuple[MapReport, RoadNetwork]:
    """Build or load the roads of a map, and time it."""
    with console.status(f"roads of {escape(spec.name)}"):
        started_s = time.perf_counter()
        network = load_network(spec, cache_dir)
        seconds = time.perf_counter() - started_s
        return MapReport(spec, statistics_of(network), network.datum, network.notes, seconds), network


def explore(
    spec: MapSpec,
    at_m: tuple[float, float] | None,
    everything: bool,
    out: Path | None,
    to: Path | None,
    cache_dir: Path,
    console: Console,
) -> MapReport:
    """Build roads and surroundings of a map, and write pictures, and the map in another form, if they are wanted."""
    report, network = build_roads(spec, cache_dir, console)
    points = to is not None and is_point_map(to)
    if to is not None and not points:
        write_map(network, to)
        if out is None and at_m is None and not everything:
            return report
    center_m = busiest_position(network) if at_m is None else np.array(at_m)
    regions = regions_of(network.layout)
    reach = Reach((float(center_m[0]), float(center_m[1])), _REACH_M)
    near = regions_of(network.layout, reach)
    if not near:
        raise InputError(f"--at {center_m[0]:g} {center_m[1]:g}: there is no road of {spec.name} near this place")
    wanted = regions if everything or points or len(regions) <= _FEW_REGIONS else near
    started_s = time.perf_counter()
    build_missing_regions(spec, network, wanted, MapDisplay(console), cache_dir)
    seconds = time.perf_counter() - started_s
    cache = StaticCache(spec, network, cache_dir)
    triangles = sum(len(tile.mesh.triangles) for region in wanted for tile in cache.region(region).tiles)
    if to is not None and points:
        with console.status(f"points of {escape(spec.name)}"):
            write_map(network, to, (cache.region(region).tiles for region in wanted))
    if out is not None:
        with console.status(f"pictures of {escape(spec.name)}"):
            shown = None if len(regions) <= _FEW_REGIONS else reach
            static = load_static_scene(spec, network, cache_dir, reach=shown)
            within_m = _VIEW_WITHIN_M if shown or at_m else math.inf
            _write_pictures(network, static, center_m, within_m, out)
    return replace(report, surroundings=Surroundings(seconds, triangles, len(wanted), len(regions)))


def _write_pictures(
    network: RoadNetwork, static: StaticScene, center_m: Float64Array, within_m: float, out: Path
) -> None:
    """Write a picture from above around a place, and one of the best street view within a distance of it."""
    from simbev_ros.show.maps.map_picture import overview_picture, write_picture
    from simbev_ros.show.street.street_view import street_view
    from simbev_ros.show.street.viewpoint import find_viewpoint

    keep_freed_memory()
    above, street = picture_files(out)
    write_picture(above, overview_picture(network, static, center_m))
    place = find_viewpoint(network, static.tiles, center_m, within_m)
    write_picture(street, street_view(network, static, *place))


def picture_files(out: Path) -> tuple[Path, Path]:
    """Files of the pictures from above and from the street."""
    return out.with_name(f"{out.stem}-above.png"), out.with_name(f"{out.stem}-street.png")
