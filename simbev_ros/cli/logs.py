"""``simbev logs``: prints how a scene of a dataset was made, with the output of the processes that made it."""

from typing import Annotated

import typer

from simbev_ros.cli.console import make_console
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.confined_paths import path_inside
from simbev_ros.foundation.files.input_file import read_small_file
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url, require_local
from simbev_ros.recording.layout import require_dataset

_MAX_BYTES = 64 << 20


def logs(
    folder: Annotated[str, typer.Argument(help="A dataset, or its URL.", metavar="DATASET", show_default=False)],
    number: Annotated[str, typer.Argument(help="Number of the scene.", metavar="NUMBER", show_default=False)],
) -> None:
    """Print the logs of a scene: failed attempts in their order, then the one that has made it.

    [bold]Examples[/]

    simbev logs datasets/first 17

    simbev logs s3://bucket/datasets/first 17
    """
    from simbev_ros.dataset.plan import Plan
    from simbev_ros.production.scene_log import scene_logs

    dataset = path_or_url(folder)
    require_dataset(dataset)
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
        console.rule(path.name, align="left")
        console.print(_read(dataset, path), end="", highlight=False, soft_wrap=True)


def _read(dataset: AnyPath, log: AnyPath) -> str:
    if isinstance(log, ObjectPath):
        content = log.read_bytes(_MAX_BYTES)
    else:
        folder = require_local(dataset)
        content = read_small_file(path_inside(folder, log.relative_to(folder)), _MAX_BYTES)
    return content.decode(errors="replace")
