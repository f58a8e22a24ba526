"""``simbev logs``: prints how a scene of a dataset was made, with the output of the processes that made it."""

from pathlib import Path
from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.confined_paths import path_inside
from simbev_ros.errors import InputError
from simbev_ros.input_file import path_exists, read_small_file
from simbev_ros.recording.layout import is_dataset

_MAX_BYTES = 64 << 20


def logs(
    dataset: Annotated[Path, typer.Argument(help="A dataset.", show_default=False)],
    number: Annotated[str, typer.Argument(help="Number of the scene.", metavar="NUMBER", show_default=False)],
) -> None:
    """Print the logs of a scene: failed attempts in their order, then the one that has made it.

    [bold]Examples[/]

    simbev logs datasets/first 17
    """
    from simbev_ros.dataset.plan import Plan
    from simbev_ros.production.scene_log import scene_logs

    if not is_dataset(dataset):
        problem = "is not a dataset" if path_exists(dataset) else "no such file or folder"
        raise InputError(f"{dataset}: {problem}")
    names = {str(entry.number): entry.name for entry in Plan.load(dataset).scenes}
    name = names.get(number.lstrip("0") or number[-1:])
    if name is None:
        numbers = f"{next(iter(names))} to {next(reversed(names))}" if names else "none, as the dataset has no scenes"
        raise InputError(f"NUMBER: {dataset} has no scene {number!r:.80}; allowed: {numbers}")
    paths = scene_logs(dataset, name)
    if not paths:
        raise InputError(f"{dataset}: scene {name} has no log yet; generate writes one for each attempt")
    console = make_console()
    for path in paths:
        text = read_small_file(path_inside(dataset, path.relative_to(dataset)), _MAX_BYTES).decode(errors="replace")
        console.rule(path.name, align="left")
        console.print(text, end="", highlight=False, soft_wrap=True)
