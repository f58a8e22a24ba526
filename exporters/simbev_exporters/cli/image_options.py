"""Options that the exports to layouts of labeled images share, and their common work."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console

from simbev_exporters.cli.pooled_export import export_agents, show_earlier
from simbev_exporters.cli.words import different_words
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
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
    """Export what the agents have recorded, and print what was made; errors are those of ``export_agents``."""
    from simbev_exporters.labeled_images.export import export_images

    export_agents(
        *(dataset, out, agent, workers, ray),
        module=type(layout).__module__,
        memory_mib=_MEMORY_MIB,
        unit="images",
        export=lambda seen, folder, pool, report: export_images(seen, folder, layout, pool=pool, report=report),
        report=lambda done, folder, console: _report(done, folder, layout, console),
    )


def _report(done: "Exported", out: Path, layout: "Layout", console: Console) -> None:
    """Print what an export has made, and what is missing in it."""
    images, objects = plural(sum(done.images.values()), "image"), plural(done.objects, "object")
    console.print(f"{images} with {objects} of {plural(done.scenes, 'scene')} in {out}")
    if done.images:
        console.print(", ".join(f"{split}: {count}" for split, count in done.images.items()))
    show_earlier(done, console)
    if done.left_out:
        console.print(f"left out, as {layout.left_out}: {', '.join(done.left_out)}")
