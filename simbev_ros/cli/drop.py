"""``simbev drop``: removes scenes from a dataset for good."""

from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.cli.scene_numbers import scene_numbers
from simbev_ros.foundation.counts import plural


def drop(
    dataset: Annotated[str, typer.Argument(help="A dataset, or its URL.", metavar="DATASET", show_default=False)],
    numbers: Annotated[
        list[str], typer.Argument(help="Numbers and ranges of scenes.", metavar="3,17-20", show_default=False)
    ],
) -> None:
    """Remove scenes from a dataset for good; their numbers are never used again.

    The next simbev generate makes a new scene in place of each, with a new number. To make a scene again as it was,
    use simbev generate --replace.

    [bold]Examples[/]

    simbev drop datasets/first 4

    simbev drop datasets/first 3,17-20

    simbev drop s3://bucket/datasets/first 4
    """
    from simbev_ros.production.drop import drop_scenes

    dropped = drop_scenes(dataset, scene_numbers("NUMBERS", numbers))
    names = ", ".join(entry.name for entry in dropped)
    make_console().print(f"{plural(len(dropped), 'scene')} dropped: {names}", highlight=False, soft_wrap=True)
