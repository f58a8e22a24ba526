"""Draws the pictures of ``simbev gallery``: towns, weathers and camera modalities."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from rich.console import Console

from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.cli.console import counting_bar
from simbev_ros.cli.output_file import make_room
from simbev_ros.cli.picture_size import picture_size_px
from simbev_ros.cli.production_display import MapDisplay
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.config.rendering import Quality
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach, regions_of
from simbev_ros.maps.source import known_maps, map_spec
from simbev_ros.maps.statistics import busiest_position
from simbev_ros.production.surroundings import build_missing_regions, load_roads
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.show import gallery
from simbev_ros.show.gallery import Picture, Section
from simbev_ros.show.street.street_view import StreetView
from simbev_ros.show.street.viewpoint import find_viewpoint

STREET_MAP = "Town10HD"
"""The map of the street that is shown in all weathers; if it is not among the maps, the first of them is taken."""

_REACH_M, _VIEW_WITHIN_M = 400.0, 260.0  # radii around the busiest place: of the surroundings, and of camera positions
_TOWNS_IN_A_ROW, _WEATHERS_IN_A_ROW, _MODALITIES_IN_A_ROW = 4, 4, 3
_TOWN_BUSY, _STREET_BUSY = 1.5, 2.2
_MIN_PX = 160


def make_gallery(
    out: Path, maps: Sequence[str], size: str, quality: Quality, seed: int, *, overwrite: bool, console: Console
) -> list[Path]:
    """Draw all pictures and their sheets; return the paths of the sheets.

    Args:
        out: The folder for the sheets; the pictures of each sheet go into a folder next to it.
        maps: Towns or map files; empty: all towns.
        size: Size of each picture, ``WIDTHxHEIGHT`` in pixels.
        quality: Quality of rendering.
        seed: Seed for everything the maps do not determine, and for the traffic.
        overwrite: Whether to replace existing pictures.
        console: Where to show the progress.

    Raises:
        InputError: A map does not exist, the size is wrong, a picture exists, or the folder cannot be written to.
        RenderError: OpenGL cannot be used on this machine.
    """
    size_px, display = picture_size_px(size, _MIN_PX), MapDisplay(console)
    specs = [map_spec(name, seed) for name in maps or known_maps()]
    street = next((spec for spec in specs if spec.name == STREET_MAP), specs[0])
    sections = _sections(specs, street)
    folders = [out / section.name for section in sections]
    make_room(out, [_sheet(out, section) for section in sections], overwrite, folders)
    for spec in specs:
        network = load_roads(spec, display)
        build_missing_regions(spec, network, regions_of(network.layout, _reach(network)), display)
    count = sum(sum(section.rows) for section in sections)
    with counting_bar("pictures", console, count, elapsed=True, remaining=False) as bar:
        drawn = _draw_pictures(specs, street, size_px, quality)
        for section in sections:
            pictures = []
            for _ in range(sum(section.rows)):
                pictures.append(next(drawn))
                gallery.write_jpeg(out / section.name / f"{pictures[-1].name}.jpg", pictures[-1].rgb)
                bar.describe(pictures[-1].title)
                bar.advance()
            gallery.write_jpeg(_sheet(out, section), gallery.draw_sheet(section, pictures))
    return [_sheet(out, section) for section in sections]


def _sections(specs: Sequence[MapSpec], street: MapSpec) -> list[Section]:
    """The sheets, in the order of the pictures of ``_draw_pictures``."""
    count = len(gallery.weathers())
    where = f"one street of {street.name}"
    return [
        Section("towns", "Towns", "one clear day", gallery.even_rows(len(specs), _TOWNS_IN_A_ROW)),
        Section("weathers", "Weather and light", where, gallery.even_rows(count, _WEATHERS_IN_A_ROW)),
        Section(
            "modalities", "One frame, all modalities", where, gallery.even_rows(len(MODALITIES), _MODALITIES_IN_A_ROW)
        ),
    ]


def _draw_pictures(
    specs: Sequence[MapSpec], street: MapSpec, size_px: tuple[int, int], quality: Quality
) -> Iterator[Picture]:
    """Draw all pictures, one after the other."""
    for spec in specs:
        with _street_view(spec, quality, _TOWN_BUSY) as view:
            yield gallery.fair_weather_picture(view, spec.name, size_px)
    with _street_view(street, quality, _STREET_BUSY) as view:
        yield from gallery.weather_pictures(view, size_px)
        yield from gallery.modality_pictures(view, size_px)


def _street_view(spec: MapSpec, quality: Quality, busy: float) -> StreetView:
    """The view from the best camera position near the busiest place of a map."""
    keep_freed_memory()
    network = load_network(spec)
    reach = _reach(network)
    static = load_static_scene(spec, network, reach=reach)
    place_m, yaw_rad = find_viewpoint(network, static.tiles, busiest_position(network), _VIEW_WITHIN_M)
    return StreetView(network, static, place_m, yaw_rad, quality, busy)


def _reach(network: RoadNetwork) -> Reach:
    x_m, y_m = busiest_position(network).tolist()
    return Reach((x_m, y_m), _REACH_M)


def _sheet(out: Path, section: Section) -> Path:
    return out / f"{section.name}.jpg"
