"""``simbev repair``: saves the readable content of a damaged bag in a new one."""

from pathlib import Path
from typing import Annotated

import typer
from rich.markup import escape
from rich.text import Text

from simbev_ros.cli.console import make_console
from simbev_ros.cli.output_file import require_name


def repair(
    bag: Annotated[Path, typer.Argument(help="A scene's bag, damaged or unfinished: its folder or its .mcap file.")],
    out: Annotated[
        Path | None, typer.Option(help="Folder of the new bag; default: the old one's, with -repaired.")
    ] = None,
) -> None:
    """Write a new bag with every message that can be read, and report the losses. The old bag stays as it is.

    [bold]Example[/]

    simbev repair datasets/first/scenes/train/Town01-0000.partial
    """
    from simbev_ros.foundation.files.whole_files import require_writable
    from simbev_ros.recording.layout import PARTIAL_SUFFIX, numbered_files, packed_files
    from simbev_ros.recording.repair import repair_bag

    if out is not None:
        require_name(out)
        require_writable(out.parent)
    folder = bag.resolve() if packed_files(bag) else next(iter(numbered_files(bag).values())).resolve().parent
    target = out or folder.with_name(folder.name.removesuffix(PARTIAL_SUFFIX) + "-repaired")
    console = make_console()
    with console.status(f"reading {escape(folder.name)}"):
        repaired = repair_bag(bag, target)
    saved = f"{sum(repaired.counts.values()):,} messages of {len(repaired.counts)} topics saved in {target}"
    console.print(saved, highlight=False, soft_wrap=True)
    for loss in repaired.lost:
        console.print(Text.assemble(("lost:", "yellow"), f" {loss}"), soft_wrap=True)
