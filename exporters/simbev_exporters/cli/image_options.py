"""Options that the exports to layouts of labeled images share, and their common work."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from simbev_exporters.cli.words import different_words
from simbev_ros.cli.agent_option import exported_agents
from simbev_ros.cli.console import counting_bar, make_console, plural
from simbev_ros.cli.pool import open_pool, shared_path
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.foundation.semantics import BOX_CLASSES, MOVING_CLASSES

if TYPE_CHECKING:
    from simbev_exporters.labeled_images.export import Exported
    from simbev_exporters.labeled_images.layout import Layout

_MEMORY_MIB = 1024

DatasetArgument = Annotated[Path, typer.Argument(help="A dataset's folder, or one scene's bag.", show_default=False)]
Out = Annotated[Path, typer.Option(help="Folder to export to.", show_default=False)]
RateHz = Annotated[float, typer.Option(help="Number of frames per second.", min=0.01, max=1000)]
Classes = Annotated[
    str | None,
    typer.Option(
        help=f"Only these classes, in this order, with commas between; default: {', '.join(MOVING_CLASSES)}.",
        metavar="NAMES",
    ),
]
Everything = Annotated[bool, typer.Option("--all", help="All classes; --classes restricts them.")]
Pixels = Annotated[int, typer.Option(help="Minimum number of visible pixels of an object.", min=1)]
Cameras = Annotated[
    str | None,
    typer.Option(help="Only these cameras, with commas between; default: all.", metavar="NAMES", show_default=False),
]


def chosen(
    rate_hz: float, classes: str | None, pixels: int, cameras: str | None = None, *, everything: bool
) -> dict[str, Any]:
    """Settings of a layout that options choose, by the names of its fields.

    Raises:
        InputError: A class is unknown, or names are empty or not different.
    """
    wanted = BOX_CLASSES if everything else MOVING_CLASSES
    if classes is not None:
        wanted = different_words("classes", classes)
        for name in wanted:
            if name not in BOX_CLASSES:
                raise InputError(f"there is no {name!r}; allowed: {', '.join(BOX_CLASSES)}", parameter="classes")
    names = {} if cameras is None else {"cameras": different_words("cameras", cameras)}
    return {"rate_hz": rate_hz, "classes": wanted, "min_pixels": pixels, **names}


def export_layout(
    dataset: Path, out: Path, layout: "Layout", agent: str | None, workers: str | None, ray: str | None
) -> None:
    """Export what the agents have recorded, and print what was made.

    Raises:
        InputError: As ``export_images`` does.
        SimbevError: A scene could not be exported.
    """
    from simbev_exporters.labeled_images.export import export_images
    from simbev_ros.dataset import open_dataset

    opened, out = open_dataset(shared_path(dataset, ray), threads=1), shared_path(out, ray)
    console, failed, scenes = make_console(soft_wrap=True, highlight=False), 0, 0
    module = type(layout).__module__
    pooled = open_pool(workers, ray, module=module, memory_mib=_MEMORY_MIB, reads=[dataset], writes=[out])
    with pooled as pool:
        for seen, folder in exported_agents(opened, agent, out):
            with counting_bar("images", make_console(stderr=True), elapsed=True) as bar:
                done = export_images(seen, folder, layout, pool=pool, report=bar.show)
            for line in _lines(done, folder, layout):
                console.print(line)
            for reason in done.failures.values():
                console.print(reason, style="red")
            failed, scenes = failed + len(done.failures), scenes + len(seen.scenes)
    if failed:
        raise SimbevError(f"{failed} of {plural(scenes, 'scene')} could not be exported")


def _lines(done: "Exported", out: Path, layout: "Layout") -> Iterator[str]:
    """Lines of text that say what was made and what is missing."""
    images, there = sum(done.images.values()), done.scenes - done.made
    yield f"{plural(images, 'image')} with {plural(done.objects, 'object')} of {plural(done.scenes, 'scene')} in {out}"
    if done.images:
        yield ", ".join(f"{split}: {count}" for split, count in done.images.items())
    if there:
        yield f"{plural(there, 'scene')} {'was' if there == 1 else 'were'} there already"
    if done.left_out:
        yield f"left out, as {layout.left_out}: {', '.join(done.left_out)}"
