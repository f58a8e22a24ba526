"""``simbev map``: what is in a map, and how it looks."""

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
from simbev_ros.cli.map_report import MapReport, Surroundings, map_table, towns_table
from simbev_ros.cli.scenes import prepare_regions
from simbev_ros.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.cache import default_cache_dir
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import known_maps
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.statistics import busiest_place, statistics_of
from simbev_ros.types import Float64Array

_WIDTH_IN_A_PIPE = 160
_REACH_M = 400.0
"""So far around a place its surroundings are built; of small maps, all."""
_FEW_REGIONS = 9
_VIEW_WITHIN_M = 260.0


def map_(
    name: Annotated[
        str | None,
        typer.Argument(help="A town, or a file (.xodr, .osm, .net.xml); default: a table of all towns.", metavar="MAP"),
    ] = None,
    seed: Annotated[int, typer.Option(help="Of all that the map leaves open.", min=0, max=2**31)] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Write PICTURE-above.png and PICTURE-street.png.", metavar="PICTURE.png")
    ] = None,
    at: Annotated[
        tuple[float, float] | None, typer.Option(help="Where to look: x y in the map, metres.", metavar="X Y")
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Surroundings of all of the map, not only around one place.")
    ] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Build from nothing, to time it.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Build a map; say what is in it, what had to be repaired, and show it from above and from the street.

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
            reports = [_explored(map_spec(name, seed), at, everything, out, cache_dir, console)]
    if as_json:
        facts = [report.facts() for report in reports]
        typer.echo(json.dumps(facts if name is None else facts[0], indent=2))
        return
    output = Console()
    if not output.is_terminal:
        output = Console(width=_WIDTH_IN_A_PIPE)
    output.print(towns_table(reports) if name is None else map_table(reports[0]))


def _roads(spec: MapSpec, cache_dir: Path, console: Console) -> tuple[MapReport, RoadNetwork]:
    """Build or load the roads."""
    with console.status(f"roads of {escape(spec.name)}"):
        started_s = time.perf_counter()
        network = load_network(spec, cache_dir)
        seconds = time.perf_counter() - started_s
        return MapReport(spec, statistics_of(network), network.datum, network.notes, seconds), network


def _explored(
    spec: MapSpec,
    at_m: tuple[float, float] | None,
    everything: bool,
    out: Path | None,
    cache_dir: Path,
    console: Console,
) -> MapReport:
    """Roads, surroundings and pictures."""
    report, network = _roads(spec, cache_dir, console)
    center_m = busiest_place(network) if at_m is None else np.array(at_m)
    regions = regions_of(network.layout)
    reach = Reach((float(center_m[0]), float(center_m[1])), _REACH_M)
    near = regions_of(network.layout, reach)
    if not near:
        raise InputError(f"--at {center_m[0]:g} {center_m[1]:g}: there is no road of {spec.name} near this place")
    wanted = regions if everything or len(regions) <= _FEW_REGIONS else near
    started_s = time.perf_counter()
    prepare_regions(spec, network, wanted, console, cache_dir)
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
    """From above, around a place, and from the street, the best view within a distance of that place."""
    from simbev_ros.viz.maps.map_picture import above, write_picture
    from simbev_ros.viz.street.street_view import street_view
    from simbev_ros.viz.street.viewpoint import street_place

    write_picture(out.with_name(f"{out.stem}-above.png"), above(network, static, center_m))
    place = street_place(network, static.tiles, center_m, within_m)
    write_picture(out.with_name(f"{out.stem}-street.png"), street_view(network, static, *place))
