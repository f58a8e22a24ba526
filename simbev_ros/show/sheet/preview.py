"""Writes the preview of a recorded scene: from a bag's frames to a contact sheet (PNG) or a video (MP4)."""

from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path

import av
import cv2
from av.video.reformatter import ColorRange, Colorspace

from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.files.whole_files import whole_file, write_whole
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.show.sheet.contact_sheet import DESIGN_WIDTH_PX, Captions, ContactSheet
from simbev_ros.show.sheet.frames import FrameReader, SheetFrame

VIDEO_WIDTH_PX = 1280
_BT709 = 1
_QUALITY = "21"
_SAME_BYTES = "mbtree=0"
"""With its macroblock tree, libx264 makes other bytes of the same frames: it reads memory that nobody has written."""


def write_picture(reader: FrameReader, index: int, path: Path) -> None:
    """Write the contact sheet of one frame as PNG.

    Args:
        reader: The scene's frames.
        index: Index of the frame in ``reader.ticks``.
        path: The file.
    """
    (frame,) = reader.frames(index, 1)
    _write_png(draw_sheet(reader, frame, DESIGN_WIDTH_PX), path)


def draw_sheet(reader: FrameReader, frame: SheetFrame, width_px: int) -> UInt8Array:
    """Draw the contact sheet of one frame as (H, width_px, 3) uint8 RGB."""
    return _sheet(reader, width_px).draw(frame)


def write_video(
    reader: FrameReader, path: Path, progress: Callable[[], None], *, width_px: int = VIDEO_WIDTH_PX, every: int = 1
) -> None:
    """Write frames as H.264 in MP4, in simulated time.

    Args:
        reader: The scene's frames.
        path: The file; it gets this name only once it is complete.
        progress: Called after each frame.
        width_px: Width of the video, even.
        every: Only every Nth frame is shown.
    """
    sheet = _sheet(reader, width_px)
    pictures = (sheet.draw(frame) for frame in reader.frames(0, len(reader.ticks), every))
    _encode(pictures, sheet.size_px, reader.rate_hz / every, path, progress)


def write_agents_picture(scene: Scene, tick: int, path: Path) -> None:
    """Write one frame as PNG, as all agents of a scene see it.

    Raises:
        InputError: The map of the scene cannot be read.
    """
    from simbev_ros.show.sheet.agents_sheet import AgentsSheet  # draws roads, which needs the simulator

    _write_png(AgentsSheet(scene).draw(tick), path)


def write_agents_video(scene: Scene, path: Path, progress: Callable[[], None]) -> None:
    """Write all frames as H.264 in MP4, in simulated time, as all agents of a scene see them.

    Args:
        scene: The scene, as any of its agents sees it.
        path: The file; it gets this name only once it is complete.
        progress: Called after each frame.

    Raises:
        InputError: The map of the scene cannot be read.
    """
    from simbev_ros.show.sheet.agents_sheet import AgentsSheet

    sheet = AgentsSheet(scene, VIDEO_WIDTH_PX)
    pictures = (sheet.draw(tick) for tick in range(len(scene)))
    _encode(pictures, sheet.size_px, NS_PER_S / scene.tick_ns, path, progress)


def _write_png(picture: UInt8Array, path: Path) -> None:
    _, data = cv2.imencode(".png", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))
    write_whole(path, data.tobytes())


def _encode(
    pictures: Iterable[UInt8Array], size_px: tuple[int, int], rate_hz: float, path: Path, progress: Callable[[], None]
) -> None:
    """Write pictures of one size as a video."""
    with (
        whole_file(path) as unfinished,
        av.open(str(unfinished), "w", format="mp4", options={"movflags": "faststart"}) as container,
    ):
        stream = container.add_stream("libx264", rate=Fraction(rate_hz).limit_denominator(1000))
        stream.width, stream.height = size_px
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": _QUALITY, "preset": "veryfast", "x264-params": _SAME_BYTES}
        context = stream.codec_context
        context.thread_count = 1  # with other numbers the bytes are others
        context.colorspace = context.color_primaries = context.color_trc = _BT709
        context.color_range = ColorRange.MPEG
        for picture in pictures:
            container.mux(stream.encode(_video_frame(picture)))
            progress()
        container.mux(stream.encode())


def _video_frame(picture: UInt8Array) -> av.VideoFrame:
    frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
    return frame.reformat(format="yuv420p", dst_colorspace=Colorspace.ITU709, dst_color_range=ColorRange.MPEG)


def _sheet(reader: FrameReader, width_px: int) -> ContactSheet:
    view = reader.scene.view
    captions = Captions(reader.scene.bag_name, _facts(view), len(reader.ticks), view.scene.start_ns)
    bev = view.annotation.bev
    half_extent_m = bev.columns * bev.cell_m / 2 if bev else 72.0
    return ContactSheet(reader.views, reader.aspects(), captions, width_px=width_px, half_extent_m=half_extent_m)


def _facts(view: AgentView) -> str:
    spec = view.scene
    parts = [
        *([f"agent {view.agent}"] if len(spec.agents) > 1 else []),
        f"seed {spec.seed}",
        f"{plural(spec.count_of('vehicle'), 'vehicle')}, {plural(spec.count_of('pedestrian'), 'pedestrian')}",
        f"sun {_weather_range(spec, 'sun_altitude_deg')}°",
        f"clouds {_weather_range(spec, 'cloudiness')} %",
        f"rain {_weather_range(spec, 'precipitation')} %",
        f"fog {_weather_range(spec, 'fog_density')} %",
    ]
    return "  ·  ".join(parts)


def _weather_range(spec: SceneSpec, parameter: str) -> str:
    """A weather parameter at the start of the scene and, if it changes, at the end."""
    moments = [spec.weather] if spec.final_weather is None else [spec.weather, spec.final_weather]
    return " to ".join(f"{getattr(weather, parameter):.0f}" for weather in moments)
