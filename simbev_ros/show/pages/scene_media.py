"""Writes the pictures and the short video of a recorded scene next to its page, unless they are newer than its bag."""

from pathlib import Path

import cv2
import numpy as np

from simbev_ros.dataset.opened import CACHE_BYTES
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.files.whole_files import write_whole
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.recording.layout import mcap_files
from simbev_ros.recording.mcap.chunk_cache import ChunkCache
from simbev_ros.show.reports.svg_drawing import jpeg_bytes
from simbev_ros.show.sheet.frames import FrameReader
from simbev_ros.show.sheet.preview import draw_sheet, write_video
from simbev_ros.show.sheet.views import find_views, main_camera_rank

THUMBNAIL, SHEET, VIDEO, PLAN = "thumbnail.jpg", "sheet.jpg", "video.mp4", "plan.jpg"
THUMBNAIL_SIZE = (320, 180)

_VIDEO_WIDTH_PX, _VIDEO_RATE_HZ = 960, 10.0


def is_newer(file: Path, bag: AnyPath) -> bool:
    """Whether a file exists and was written after a bag."""
    return file.exists() and file.stat().st_mtime_ns > max(each.stat().st_mtime_ns for each in mcap_files(bag))


def write_media(bag: AnyPath, folder: Path, *, video: bool) -> bool:
    """Write what there is to see of a scene: a thumbnail, a sheet of all sensors, and a video of them.

    Args:
        bag: The scene's bag.
        folder: Folder of its page.
        video: Whether to write a video.

    Returns:
        Whether there is anything to see; no file is written otherwise.

    Raises:
        BagError: The bag is damaged.
        OSError: A file cannot be written.
    """
    files = [folder / name for name in (THUMBNAIL, SHEET, *([VIDEO] if video else []))]
    if all(is_newer(file, bag) for file in files):
        return True
    scene = Scene(bag, ChunkCache(CACHE_BYTES), may_be_cut_off=True)
    try:
        views = find_views(scene, "panel")
    except BagError:  # the bag is sound, but has nothing that can be shown
        return False
    reader = FrameReader(scene, views)
    (frame,) = reader.frames(reader.middle, 1)
    sheet = draw_sheet(reader, frame, _VIDEO_WIDTH_PX * 3 // 2)
    camera = next(
        (name for name in sorted(views.cameras, key=main_camera_rank) if views.cameras[name] in frame.arrays), ""
    )
    write_whole(folder / SHEET, jpeg_bytes(sheet))
    write_whole(folder / THUMBNAIL, jpeg_bytes(_fill(frame.arrays[views.cameras[camera]] if camera else sheet)))
    if video and not is_newer(folder / VIDEO, bag):
        every = max(1, round(reader.rate_hz / _VIDEO_RATE_HZ))
        write_video(reader, folder / VIDEO, lambda: None, width_px=_VIDEO_WIDTH_PX, every=every)
    return True


def _fill(picture: UInt8Array) -> UInt8Array:
    """The middle of an RGB picture, scaled to the size of a thumbnail."""
    (width, height), (rows, columns) = THUMBNAIL_SIZE, picture.shape[:2]
    scale = max(width / columns, height / rows)
    size = max(round(columns * scale), width), max(round(rows * scale), height)
    scaled = np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)
    top, left = (size[1] - height) // 2, (size[0] - width) // 2
    return scaled[top : top + height, left : left + width]
