"""Makes the pictures of a gallery (towns, weathers, camera modalities) and arranges them on sheets.

A ``StreetView`` enters; single pictures, and sheets with captions, leave. ``simbev gallery`` writes them as JPEG files.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np

from simbev_ros.config.modalities import IMAGE_KINDS, MODALITIES
from simbev_ros.drawing.canvas import BACKGROUND, BOLD, DIM, draw_label, draw_picture, draw_text
from simbev_ros.drawing.panels import MODALITY_PICTURES
from simbev_ros.foundation.files.whole_files import write_errors, write_whole
from simbev_ros.foundation.tables import load_table
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.show.sheet.layout import Block, Column, Row, Tile, place_in_width
from simbev_ros.show.street.street_view import StreetView

SHEET_WIDTH_PX = 1920
_MARGIN, _GAP, _HEADER, _RADIUS = 24, 10, 74, 7
_JPEG_QUALITY = 92


class Picture(NamedTuple):
    """One picture of a gallery: the stem of its file, its title and note on the sheet, and (H, W, 3) uint8 RGB."""

    name: str
    title: str
    note: str
    rgb: UInt8Array


class Section(NamedTuple):
    """One sheet of a gallery: the stem of its file, its heading, and the number of pictures in each row."""

    name: str
    title: str
    facts: str
    rows: Sequence[int]


@lru_cache(maxsize=1)
def weathers() -> Mapping[str, Mapping[str, Any]]:
    """The gallery's weathers by name: title, bearing of the sun, and the fields of a ``Weather``."""
    return load_table("simbev_ros.show", "gallery.yaml")


def fair_weather_picture(view: StreetView, name: str, size_px: tuple[int, int]) -> Picture:
    """Take a picture of a street on a sunny day, with ``name`` as title and as the stem of the file."""
    return Picture(name, name, "", _rgb(view, view.fair_weather(), size_px))


def weather_pictures(view: StreetView, size_px: tuple[int, int]) -> Iterator[Picture]:
    """Take a picture of a street in each weather of the gallery."""
    for name, entry in weathers().items():
        given = {key: value for key, value in entry.items() if key not in ("title", "sun_bearing_deg")}
        weather = Weather(**given, sun_azimuth_deg=view.sun_azimuth_deg(entry["sun_bearing_deg"]))
        yield Picture(name, entry["title"], "", _rgb(view, weather, size_px))


def modality_pictures(view: StreetView, size_px: tuple[int, int]) -> Iterator[Picture]:
    """Take one frame of a street in all modalities of a camera, with labels as colors."""
    images = view.photograph(view.fair_weather(), size_px, MODALITIES)
    assert images.rgb is not None
    yield Picture("rgb", IMAGE_KINDS["rgb"].title, "", images.rgb)
    for name, shown in MODALITY_PICTURES.items():
        picture = shown.picture(getattr(images, name), images.rgb, size_px[0])
        yield Picture(name, IMAGE_KINDS[name].title, shown.note, picture)


def draw_sheet(section: Section, pictures: Sequence[Picture]) -> UInt8Array:
    """Draw all pictures of a section in rows, each with its title, under one heading: (H, W, 3) uint8 RGB."""
    remaining = iter(pictures)
    rows = [Row([_tile(next(remaining)) for _ in range(count)]) for count in section.rows]
    blocks: list[Block] = [row for row in rows if row.blocks]
    boxes = place_in_width(Column(blocks), _MARGIN, _HEADER, SHEET_WIDTH_PX - 2 * _MARGIN, _GAP)
    height = max(box.top + box.height for box in boxes.values()) + _MARGIN
    result = np.full((height, SHEET_WIDTH_PX, 3), BACKGROUND, np.uint8)
    end = draw_text(result, section.title, _MARGIN, 48, size=30, weight=BOLD)
    draw_text(result, section.facts, end + 20, 48, size=18, color=DIM)
    for picture in pictures:
        draw_picture(result, picture.rgb, boxes[picture.name], _RADIUS)
        draw_label(result, boxes[picture.name], picture.title, picture.note, 1.0)
    return result


def even_rows(count: int, max_length: int) -> list[int]:
    """Lengths of the rows of ``count`` pictures, as even as possible; shorter rows, of larger pictures, come first."""
    rows = -(-count // max_length)
    return sorted(count // rows + (row < count % rows) for row in range(rows))


def write_jpeg(path: Path, picture: UInt8Array) -> None:
    """Write (H, W, 3) RGB as a JPEG file, and make its folder if necessary.

    Raises:
        InputError: The file cannot be written.
    """
    settings = [cv2.IMWRITE_JPEG_QUALITY, _JPEG_QUALITY]
    with write_errors(path):
        write_whole(path, cv2.imencode(".jpg", np.ascontiguousarray(picture[..., ::-1]), settings)[1].tobytes())


def _rgb(view: StreetView, weather: Weather, size_px: tuple[int, int]) -> UInt8Array:
    rgb = view.photograph(weather, size_px).rgb
    assert rgb is not None
    return rgb


def _tile(picture: Picture) -> Tile:
    return Tile(picture.name, picture.rgb.shape[1] / picture.rgb.shape[0])
