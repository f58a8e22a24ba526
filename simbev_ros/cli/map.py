"""``simbev map``: builds a map, prints its statistics and draws pictures of it."""

import json
import math
import tempfile
import time
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.markup import escape

from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import StaticCache, load_static_scene
from simbev_ros.cache.entries import default_cache_dir
from simbev_ros.cli.console import table_console
from simbev_ros.cli.map_report import MapReport, Surroundings, map_table, towns_table
from simbev_ros.cli.production_display import MapDisplay
from simbev_ros.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import known_maps
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.statistics import busiest_position, statistics_of
from simbev_ros.process_memory import keep_freed_memory
from simbev_ros.production.surroundings import build_missing_regions
from simbev_ros.types import Float64Array

_REACH_M = 400.0
"""Radius around a place in which its surroundings are built; those of small maps are built completely."""
_FEW_REGIONS = 9
_VIEW_WITHIN_M = 260.0


def map_(
    name: Annotated[
        str | None,
        typer.Argument(help="A town, or a file (.xodr, .osm, .net.xml); default: a table of all towns.", metavar="MAP"),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed for everything the map does not determine.", min=0, max=2**31)] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Write PICTURE-above.png and PICTURE-street.png.", metavar="PICTURE.png")
    ] = None,
    at: Annotated[
        tuple[float, float] | None, typer.Option(help="Position of the pictures in the map, in meters.", metavar="X Y")
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Build the surroundings of the whole map, not only around one position.")
    ] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Build without the cache, for timing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Build a map, print its statistics and what had to be repaired, and show it from above and from the street.

    [bold]Examples[/]

    simbev map

    simbev map Town04 --out town04.png

    simbev map my_city.osm --fresh --json
    """
    console = Console(stderr=True)
    with tempfile.TemporaryDirectory(prefix="simbev_ros-map-") if fresh else nullcontext() as folder:
        cache_dir = Path(folder) if folder else default_cache_dir()
        if name is None:
            reports = [_roads(map_spec(town, seed), cache_dir, console)[0] for town in known_maps()]
        else:
            reports = [_explore(map_spec(name, seed), at, everything, out, cache_dir, console)]
    if as_json:
        facts = [report.facts() for report in reports]
        typer.echo(json.dumps(facts if name is None else facts[0], indent=2))
        return
    table_console().print(towns_table(reports) if name is None else map_table(reports[0]))


def _roads(spec: MapSpec, cache_dir: Path, console: Console) -> tuple[MapReport, RoadNetwork]:
    """Build or load the roads of a map, and time it."""
    with console.status(f"roads of {escape(spec.name)}"):
        started_s = time.perf_counter()
        network = load_network(spec, cache_dir)
        seconds = time.perf_counter() - started_s
        return MapReport(spec, statistics_of(network), network.datum, network.notes, seconds), network


def _explore(
    spec: MapSpec,
    at_m: tuple[float, float] | None,
    everything: bool,
    out: Path | None,
    cache_dir: Path,
    console: Console,
) -> MapReport:
    """Build roads and surroundings of a map, and write pictures if they are wanted."""
    report, network = _roads(spec, cache_dir, console)
    center_m = busiest_position(network) if at_m is None else np.array(at_m)
    regions = regions_of(network.layout)
    reach = Reach((float(center_m[0]), float(center_m[1])), _REACH_M)
    near = regions_of(network.layout, reach)
    if not near:
        raise InputError(f"--at {center_m[0]:g} {center_m[1]:g}: there is no road of {spec.name} near this place")
    wanted = regions if everything or len(regions) <= _FEW_REGIONS else near
    started_s = time.perf_counter()
    build_missing_regions(spec, network, wanted, MapDisplay(console), cache_dir)
    seconds = time.perf_counter() - started_s
    cache = StaticCache(spec, network, cache_dir)
    triangles = sum(len(tile.mesh.triangles) for region in wanted for tile in cache.region(region).tiles)
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
    from simbev_ros.viz.maps.map_picture import above, write_picture
    from simbev_ros.viz.street.street_view import street_view
    from simbev_ros.viz.street.viewpoint import street_place

    keep_freed_memory()
    write_picture(out.with_name(f"{out.stem}-above.png"), above(network, static, center_m))
    place = street_place(network, static.tiles, center_m, within_m)
    write_picture(out.with_name(f"{out.stem}-street.png"), street_view(network, static, *place))
