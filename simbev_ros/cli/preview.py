"""``simbev preview``: pictures and a video of a recorded scene."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer
from rich.console import Console

from simbev_ros.cli.agent_option import ALL, ShownAgentOption, require_agent
from simbev_ros.cli.console import make_console, percent_bar
from simbev_ros.cli.output_file import Overwrite, make_room, show_written
from simbev_ros.foundation.errors import InputError
from simbev_ros.show.sheet import LabelPlacement

if TYPE_CHECKING:
    from simbev_ros.dataset.scene import Scene


def preview(
    bag: Annotated[Path, typer.Argument(help="A scene's bag: its folder or its .mcap file.", show_default=False)],
    out: Annotated[Path, typer.Option(help="Folder for the pictures.")] = Path(),
    frame: Annotated[int | None, typer.Option(help="Frame of the contact sheet; by default the middle one.")] = None,
    labels: Annotated[
        LabelPlacement,
        typer.Option(help="Drawn over: nothing (off), one more picture and views from above (panel), all (cameras)."),
    ] = "panel",
    agent: ShownAgentOption = None,
    video: Annotated[bool, typer.Option(help="Also write an MP4 of all frames.")] = True,
    overwrite: Overwrite = False,
) -> None:
    """Write a contact sheet (PNG) of one frame and a video (MP4) of all frames of a recorded scene.

    [bold]Examples[/]

    simbev preview out/demo/scenes/train/Blocks-0000 --out pictures

    simbev preview out/demo/scenes/train/Blocks-0000 --frame 12 --no-video

    simbev preview out/agents/scenes/train/Town05-0000 --agent all
    """
    console = make_console()
    shown: dict[str, Any] = {"frame": frame, "labels": labels, "agent": agent, "video": video}
    show_written(make_preview(bag, out, **shown, overwrite=overwrite, console=console), console)


def make_preview(
    path: Path,
    out: Path,
    *,
    frame: int | None = None,
    labels: LabelPlacement = "panel",
    agent: str | None = None,
    video: bool = True,
    overwrite: bool = False,
    console: Console,
) -> list[Path]:
    """Write the pictures of a bag and return their paths: ``<scene>.png`` and ``<scene>.mp4``.

    If an agent is named, its name follows that of the scene, as in ``<scene>.car_2.png``; ``all`` shows all of them.

    Raises:
        InputError: The agent or the frame does not exist, a picture exists already, or the folder cannot be made.
        BagError: The bag cannot be read, or has no topic that can be shown.
    """
    from simbev_ros.dataset.opened import CACHE_BYTES
    from simbev_ros.dataset.scene import Scene
    from simbev_ros.recording.mcap.chunk_cache import ChunkCache

    scene = Scene(path, ChunkCache(CACHE_BYTES), may_be_cut_off=True)
    bag = scene.bag_name
    if agent is not None:
        require_agent(agent, [*scene.agents, ALL] if len(scene.agents) > 1 else scene.agents, bag)
    seen = scene if agent in (None, ALL) else scene.of_agent(agent)
    shown = _all_agents(scene) if agent == ALL else _one_agent(seen, labels)
    index = shown.middle if frame is None else frame
    if not 0 <= index < shown.frames:
        raise InputError(f"--frame {index}: {bag} has frames 0 to {shown.frames - 1}")
    name = bag if agent is None else f"{bag}.{agent}"
    picture, film = out / f"{name}.png", out / f"{name}.mp4"
    targets = [picture, film] if video else [picture]
    make_room(out, targets, overwrite)
    shown.write_picture(index, picture)
    if video:
        with percent_bar("video", console, shown.frames) as bar:
            shown.write_video(film, bar.advance)
    return targets


class _Shown(NamedTuple):
    """What is shown of a scene.

    Attributes:
        frames: Number of frames.
        middle: Index of the frame in the middle, with boxes if any frame has them.
        write_picture: Writes the frame with an index to a file as PNG.
        write_video: Writes all frames to a file as MP4, and calls a function after each.
    """

    frames: int
    middle: int
    write_picture: Callable[[int, Path], None]
    write_video: Callable[[Path, Callable[[], None]], None]


def _one_agent(scene: "Scene", labels: LabelPlacement) -> _Shown:
    """Recorded data of one agent."""
    from simbev_ros.show.sheet.frames import FrameReader
    from simbev_ros.show.sheet.preview import write_picture, write_video
    from simbev_ros.show.sheet.views import find_views

    reader = FrameReader(scene, find_views(scene, labels))
    return _Shown(len(reader.ticks), reader.middle, partial(write_picture, reader), partial(write_video, reader))


def _all_agents(scene: "Scene") -> _Shown:
    """Recorded data of all agents of a scene."""
    from simbev_ros.show.sheet.frames import middle_frame
    from simbev_ros.show.sheet.preview import write_agents_picture, write_agents_video

    middle = middle_frame(scene.has(["world/boxes"]))
    return _Shown(len(scene), middle, partial(write_agents_picture, scene), partial(write_agents_video, scene))
