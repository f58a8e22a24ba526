"""The command ``simbev map``."""

import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.output_file import require_name, require_place
from simbev_ros.foundation.errors import InputError

Name = Annotated[
    str | None,
    typer.Argument(
        help="A town, or a file (.xodr, .osm, .osm.pbf, .net.xml; also .gz); default: a table of all towns.",
        metavar="MAP",
    ),
]
Seed = Annotated[int, typer.Option(help="Seed for everything the map does not determine.", min=0, max=2**31)]
Out = Annotated[
    Path | None, typer.Option(help="Write PICTURE-above.png and PICTURE-street.png.", metavar="PICTURE.png")
]
To = Annotated[
    Path | None,
    typer.Option(
        help="Write another form: .xodr, .net.xml, .osm, lanelet2_map.osm or pointcloud_map.pcd.",
        metavar="FILE",
    ),
]
At = Annotated[
    tuple[float, float] | None, typer.Option(help="Position of the pictures in the map, in meters.", metavar="X Y")
]
Bounds = Annotated[
    str | None, typer.Option(help="Part of an OpenStreetMap file, in degrees.", metavar="WEST,SOUTH,EAST,NORTH")
]
Everything = Annotated[
    bool, typer.Option("--all", help="Build the surroundings of the whole map, not only around one position.")
]
Check = Annotated[
    bool, typer.Option("--check", help="List what was left out, repaired or assumed; with --out, mark it on a plan.")
]
MaxLoss = Annotated[
    float, typer.Option(help="With --check: percent of lanes that may be lost; beyond, exit code 1.", min=0, max=100)
]
Fresh = Annotated[bool, typer.Option("--fresh", help="Build without the cache, for timing.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")]


def map_(
    name: Name = None,
    seed: Seed = 0,
    out: Out = None,
    to: To = None,
    at: At = None,
    bounds: Bounds = None,
    everything: Everything = False,
    check: Check = False,
    max_loss: MaxLoss = 1.0,
    fresh: Fresh = False,
    as_json: AsJson = False,
) -> None:
    """Build a map, print its statistics and what had to be repaired, and show it from above and from the street.

    [bold]Examples[/]

    simbev map

    simbev map Town04 --out town04.png

    simbev map my_city.osm --fresh --json

    simbev map my_city.osm --to my_city.xodr

    simbev map Town04 --to autoware/lanelet2_map.osm

    simbev map Town04 --to autoware/pointcloud_map.pcd

    simbev map my_city.xodr --check --out my_city.png

    simbev map berlin.osm.pbf --bounds 13.37,52.50,13.42,52.53 --out berlin.png
    """
    from simbev_ros.cli.console import make_console, table_console
    from simbev_ros.cli.map.check import print_check
    from simbev_ros.cli.map.exploration import build_roads, explore
    from simbev_ros.cli.map.report import map_table, towns_table
    from simbev_ros.config.map_files import parse_bounds
    from simbev_ros.maps.source import known_maps, map_spec

    part = None if bounds is None else parse_bounds(bounds)
    _require_map(name, {"bounds": bounds is not None, "to": to is not None, "check": check})
    _require_places(out, to, check=check)
    if check and (to is not None or at is not None or everything):
        raise InputError("goes with --out and --json, not with --to, --at or --all", parameter="check")
    console = make_console(stderr=True)
    with _cache_dir(fresh=fresh) as cache_dir:
        if name is None:
            reports = [build_roads(map_spec(town, seed), cache_dir, console)[0] for town in known_maps()]
        elif check:
            is_good = print_check(map_spec(name, seed, part), max_loss, out, as_json, cache_dir, console)
            raise typer.Exit(0 if is_good else 1)
        else:
            reports = [explore(map_spec(name, seed, part), at, everything, out, to, cache_dir, console)]
    if as_json:
        facts = [report.facts() for report in reports]
        typer.echo(json.dumps(facts if name is None else facts[0], indent=2))
        return
    table_console().print(towns_table(reports) if name is None else map_table(reports[0]))


def _require_map(name: str | None, options: Mapping[str, bool]) -> None:
    """Refuse options that are about one map where none is named."""
    given = next((option for option, is_given in options.items() if is_given), None)
    if name is None and given is not None:
        raise InputError("needs a map", parameter=given)


def _require_places(out: Path | None, to: Path | None, *, check: bool) -> None:
    """Refuse files that cannot be written."""
    from simbev_ros.cli.map.check import check_file
    from simbev_ros.cli.map.exploration import picture_files
    from simbev_ros.export.maps.conversion import files_of

    if out is not None:
        require_name(out)
    pictures = () if out is None else (check_file(out),) if check else picture_files(out)
    for file in (*pictures, *(files_of(to) if to is not None else ())):
        require_place(file, folder_is_made=True)


@contextmanager
def _cache_dir(*, fresh: bool) -> Iterator[Path]:
    """The cache of maps, or an empty one for the time of this context."""
    if not fresh:
        from simbev_ros.foundation.cache.entries import default_cache_dir

        yield default_cache_dir()
        return
    with tempfile.TemporaryDirectory(prefix="simbev_ros-map-") as folder:
        yield Path(folder)
