"""The command ``simbev map``."""

import json
import tempfile
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer


def map_(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A town, or a file (.xodr, .osm, .osm.pbf, .net.xml; also .gz); default: a table of all towns.",
            metavar="MAP",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed for everything the map does not determine.", min=0, max=2**31)] = 0,
    out: Annotated[
        Path | None, typer.Option(help="Write PICTURE-above.png and PICTURE-street.png.", metavar="PICTURE.png")
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option(help="Write the roads in another form: .xodr, .net.xml or .osm.", metavar="FILE"),
    ] = None,
    at: Annotated[
        tuple[float, float] | None, typer.Option(help="Position of the pictures in the map, in meters.", metavar="X Y")
    ] = None,
    bounds: Annotated[
        str | None, typer.Option(help="Part of an OpenStreetMap file, in degrees.", metavar="WEST,SOUTH,EAST,NORTH")
    ] = None,
    everything: Annotated[
        bool, typer.Option("--all", help="Build the surroundings of the whole map, not only around one position.")
    ] = False,
    check: Annotated[
        bool,
        typer.Option("--check", help="List what was left out, repaired or assumed; with --out, mark it on a plan."),
    ] = False,
    max_loss: Annotated[
        float,
        typer.Option(help="With --check: percent of lanes that may be lost; beyond, exit code 1.", min=0, max=100),
    ] = 1.0,
    fresh: Annotated[bool, typer.Option("--fresh", help="Build without the cache, for timing.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Build a map, print its statistics and what had to be repaired, and show it from above and from the street.

    [bold]Examples[/]

    simbev map

    simbev map Town04 --out town04.png

    simbev map my_city.osm --fresh --json

    simbev map my_city.osm --to my_city.xodr

    simbev map my_city.xodr --check --out my_city.png

    simbev map berlin.osm.pbf --bounds 13.37,52.50,13.42,52.53 --out berlin.png
    """
    from simbev_ros.cli.console import make_console, table_console
    from simbev_ros.cli.map.check import print_check
    from simbev_ros.cli.map.exploration import build_roads, explore
    from simbev_ros.cli.map.report import map_table, towns_table
    from simbev_ros.cli.output_file import require_name
    from simbev_ros.config.map_files import parse_bounds
    from simbev_ros.export.maps.conversion import writer_of
    from simbev_ros.foundation.cache.entries import default_cache_dir
    from simbev_ros.foundation.errors import InputError
    from simbev_ros.foundation.files.whole_files import require_writable
    from simbev_ros.maps.source import known_maps, map_spec

    part = None if bounds is None else parse_bounds(bounds)
    if part is not None and name is None:
        raise InputError("need a map", parameter="bounds")
    if out is not None:
        require_name(out)
        require_writable(out.parent)
    if to is not None:
        if name is None:
            raise InputError("a form to write needs a map", parameter="to")
        writer_of(to)
        require_writable(to.parent)
    if check and name is None:
        raise InputError("a check needs a map", parameter="check")
    if check and (to is not None or at is not None or everything):
        raise InputError("goes with --out and --json, not with --to, --at or --all", parameter="check")
    console = make_console(stderr=True)
    with tempfile.TemporaryDirectory(prefix="simbev_ros-map-") if fresh else nullcontext() as folder:
        cache_dir = Path(folder) if folder else default_cache_dir()
        if check and name is not None:
            is_good = print_check(map_spec(name, seed, part), max_loss, out, as_json, cache_dir, console)
            raise typer.Exit(0 if is_good else 1)
        if name is None:
            reports = [build_roads(map_spec(town, seed), cache_dir, console)[0] for town in known_maps()]
        else:
            reports = [explore(map_spec(name, seed, part), at, everything, out, to, cache_dir, console)]
    if as_json:
        facts = [report.facts() for report in reports]
        typer.echo(json.dumps(facts if name is None else facts[0], indent=2))
        return
    table_console().print(towns_table(reports) if name is None else map_table(reports[0]))
