"""``simbev demo``: makes a bag, a picture and a video of one short scene."""

import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from simbev_ros.cli.console import make_console, own_command
from simbev_ros.cli.view.beside_run import ViewOption, ViewPortOption, viewer_beside
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import path_exists
from simbev_ros.foundation.installation.extras import install_command, load_extras
from simbev_ros.recording.layout import PARTIAL_SUFFIX, scenes_of
from simbev_ros.ros.graph.interrupts import Interrupted


def demo(
    out: Annotated[
        Path | None, typer.Option(help="Folder to make; default: out/demo, or the next free out/demo-2, …")
    ] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the scene.", min=0, max=2**31, show_default=False)] = None,
    view: ViewOption = False,
    view_port: ViewPortOption = None,
) -> None:
    """Simulate, sense, label and record one short scene, and draw a preview of it.

    [bold]Examples[/]

    simbev demo

    simbev demo --seed 12 --out /tmp/demo12
    """
    from simbev_ros.cli.preview import make_preview
    from simbev_ros.cli.production_display import SceneDisplay
    from simbev_ros.production.observer import SeveralObservers
    from simbev_ros.production.play import play_scenes

    console = make_console()
    scenario = load_scenario("demo")
    if seed is not None:
        scenario = scenario.model_copy(update={"seed": seed})
    folder = out or _free_folder(Path("out/demo"))
    if path_exists(folder):
        raise InputError(f"--out {folder}: exists already; nothing was overwritten")
    with _saying_what_stays(folder), viewer_beside(view_port, console, wanted=view) as viewer:
        (bag,) = play_scenes(scenario, dataset=folder, observer=SeveralObservers(SceneDisplay(console), viewer))
        preview = make_preview(bag, folder, console=console)
        _print_result(bag, preview, console)


@contextmanager
def _saying_what_stays(folder: Path) -> Iterator[None]:
    """After an interrupt, say what stays in the folder of the demo; without a scene in it, remove the folder."""
    try:
        yield
    except (Interrupted, KeyboardInterrupt):
        scenes, command = scenes_of(folder) if folder.is_dir() else [], own_command()
        for bag in scenes:
            is_cut_off = bag.name.endswith(PARTIAL_SUFFIX)
            use = f"{command} repair {bag} saves" if is_cut_off else f"{command} preview {bag} draws"
            make_console(stderr=True, soft_wrap=True).print(f"{bag} stays; {use} what is in it", highlight=False)
        if not scenes:
            shutil.rmtree(folder, ignore_errors=True)
        raise


def _print_result(bag: Path, preview: Sequence[Path], console: Console) -> None:
    """Print what was made and what to do with it."""
    command = own_command()
    console.print()
    console.print(f"bag      {bag}", soft_wrap=True)
    for path in preview:
        console.print(f"preview  {path}", soft_wrap=True)
    console.print("\nWhat next", style="bold")
    steps = {f"{command} info {bag}": "what is in it"}
    if load_extras()["view"].missing:
        steps[install_command("view")] = "install the viewer, once"
    steps[f"{command} view {bag}"] = "look at it in the browser"
    if shutil.which("ros2"):
        steps[f"ros2 bag play {bag}"] = "or open the .mcap file in Foxglove or Lichtblick"
    steps[f"{command} run live --live"] = "stream to your own nodes"
    for step, use in steps.items():
        console.print(f"  {step}\n      {use}", highlight=False, soft_wrap=True)


def _free_folder(wanted: Path) -> Path:
    """The path, or the first of ``path-2``, ``path-3``, … that does not exist."""
    number, path = 1, wanted
    while path.exists():
        number += 1
        path = wanted.with_name(f"{wanted.name}-{number}")
    return path
