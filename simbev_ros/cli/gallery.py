"""``simbev preview --gallery``: towns, weathers and modalities in pictures; builds what they show."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.cli.picture_size import picture_size_px
from simbev_ros.cli.preview import make_room
from simbev_ros.cli.scenes import map_roads, prepare_regions
from simbev_ros.config.camera import MODALITIES
from simbev_ros.config.rendering import Quality
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.recipe import known_maps
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.maps.source import map_spec
from simbev_ros.maps.spec import MapSpec
from simbev_ros.maps.statistics import busiest_place
from simbev_ros.viz import gallery
from simbev_ros.viz.gallery import Picture, Section
from simbev_ros.viz.street.street_view import StreetView
from simbev_ros.viz.street.viewpoint import street_place

STREET_MAP = "Town10HD"
"""Where the street of all weathers is, if it is among the maps; else it is in the first of them."""

_REACH_M, _VIEW_WITHIN_M = 400.0, 260.0  # around the busiest place: what is built, and where the camera may stand
_TOWNS_IN_A_ROW, _WEATHERS_IN_A_ROW, _MODALITIES_IN_A_ROW = 4, 4, 3
_TOWN_BUSY, _STREET_BUSY = 1.5, 2.2
_LEAST_PX = 160


def make_gallery(
    out: Path, maps: Sequence[str], size: str, quality: Quality, seed: int, *, overwrite: bool, console: Console
) -> list[Path]:
    """Draw all pictures and their sheets; give the paths of the sheets.

    Args:
        out: The folder: a sheet for each section, and next to it a folder with its pictures.
        maps: Towns or map files; none: all towns.
        size: Of each picture, ``WIDTHxHEIGHT`` in pixels.
        quality: Of drawing.
        seed: Of all that the maps leave open, and of who is on the road.
        overwrite: Replace pictures that are there.
        console: For progress.

    Raises:
        InputError: No such map, no such size, or pictures are there already, or the folder cannot be written.
        RenderError: OpenGL is not usable here.
    """
    size_px = picture_size_px(size, _LEAST_PX)
    specs = [map_spec(name, seed) for name in maps or known_maps()]
    street = next((spec for spec in specs if spec.name == STREET_MAP), specs[0])
    sections = _sections(specs, street)
    make_room(out, [path for section in sections for path in (_sheet(out, section), out / section.name)], overwrite)
    for spec in specs:
        network = map_roads(spec, console)
        prepare_regions(spec, network, regions_of(network.layout, _reach(network)), console)
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=None), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, expand=True, transient=True) as bars:
        task = bars.add_task("pictures", total=sum(sum(section.rows) for section in sections))
        drawn = _drawn(specs, street, size_px, quality)
        for section in sections:
            pictures = []
            for _ in range(sum(section.rows)):
                pictures.append(next(drawn))
                gallery.write_jpeg(out / section.name / f"{pictures[-1].name}.jpg", pictures[-1].rgb)
                bars.update(task, advance=1, description=escape(pictures[-1].title))
            gallery.write_jpeg(_sheet(out, section), gallery.sheet(section, pictures))
    return [_sheet(out, section) for section in sections]


def _sections(specs: Sequence[MapSpec], street: MapSpec) -> list[Section]:
    """The sheets, in the order in which ``_drawn`` gives their pictures."""
    count = len(gallery.weathers())
    where = f"one street of {street.name}"
    return [
        Section("towns", "Towns", "one clear day", gallery.even_rows(len(specs), _TOWNS_IN_A_ROW)),
        Section("weathers", "Weather and light", where, gallery.even_rows(count, _WEATHERS_IN_A_ROW)),
        Section(
            "modalities", "One frame, five modalities", where, gallery.even_rows(len(MODALITIES), _MODALITIES_IN_A_ROW)
        ),
    ]


def _drawn(specs: Sequence[MapSpec], street: MapSpec, size_px: tuple[int, int], quality: Quality) -> Iterator[Picture]:
    """All pictures, one after the other."""
    for spec in specs:
        with _street_view(spec, quality, _TOWN_BUSY) as view:
            yield gallery.in_fair_weather(view, spec.name, size_px)
    with _street_view(street, quality, _STREET_BUSY) as view:
        yield from gallery.in_all_weathers(view, size_px)
        yield from gallery.in_all_modalities(view, size_px)


def _street_view(spec: MapSpec, quality: Quality, busy: float) -> StreetView:
    """From the best place near the busiest one."""
    network = load_network(spec)
    reach = _reach(network)
    static = load_static_scene(spec, network, reach=reach)
    place_m, yaw_rad = street_place(network, static.tiles, busiest_place(network), _VIEW_WITHIN_M)
    return StreetView(network, static, place_m, yaw_rad, quality, busy)


def _reach(network: RoadNetwork) -> Reach:
    x_m, y_m = busiest_place(network).tolist()
    return Reach((x_m, y_m), _REACH_M)


def _sheet(out: Path, section: Section) -> Path:
    return out / f"{section.name}.jpg"
