"""``simbev verify``: checks that bags and datasets are complete and undamaged."""

import json
import os
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from simbev_ros.cli.console import counting_bar, make_console, plural
from simbev_ros.errors import InputError
from simbev_ros.input_file import path_exists
from simbev_ros.recording.layout import is_dataset, scenes_of

if TYPE_CHECKING:
    from simbev_ros.recording.verify import Fault

_MAX_SHOWN = 200


def verify(
    paths: Annotated[list[Path], typer.Argument(help="Scenes' bags, their .mcap files, or datasets.")],
    jobs: Annotated[int | None, typer.Option(help="Bags to read at once; default: number of cores.", min=1)] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Read every byte and check checksums, indexes, types, payloads, stamps, and the completeness of scenes.

    The exit code is 1 if anything is wrong.

    [bold]Examples[/]

    simbev verify out/demo

    simbev verify datasets/first datasets/second --json
    """
    from simbev_ros.dataset.check import dataset_faults

    for path in paths:
        if not path_exists(path):
            raise InputError(f"{path}: no such file or folder")
    bags = [bag for path in paths for bag in (scenes_of(path) if is_dataset(path) else [path])]
    jobs = jobs or os.cpu_count() or 1
    faults = _faults(bags, jobs)
    faults += [fault for path in paths if is_dataset(path) for fault in dataset_faults(path, jobs)]
    if not bags and not faults:
        raise InputError(f"{', '.join(map(str, paths))}: there is no scene to verify")
    if as_json:
        print(json.dumps({"bags": len(bags), "faults": [_plain(fault) for fault in faults]}, indent=2))
    else:
        _print(len(bags), faults)
    raise typer.Exit(1 if faults else 0)


def _faults(bags: Sequence[Path], jobs: int) -> "list[Fault]":
    """The faults of all bags, in the order of the bags, which are read in parallel."""
    from simbev_ros.dataset.parallel import map_in_processes
    from simbev_ros.recording.verify import verify_bag

    faults: list[Fault] = []
    with counting_bar("bags", make_console(stderr=True), len(bags)) as bar:
        for found in map_in_processes(verify_bag, bags, min(jobs, max(len(bags), 1))):
            faults += found
            bar.advance()
    return faults


def _plain(fault: "Fault") -> dict[str, str]:
    return {name: str(value) for name, value in asdict(fault).items()}


def _print(bags: int, faults: "Sequence[Fault]") -> None:
    console = make_console()
    if not faults:
        console.print(f"{plural(bags, 'bag')}: nothing is wrong", style="green")
        return
    table = Table()
    for title in ("bag", "where", "what"):
        table.add_column(title, overflow="fold")
    for fault in faults[:_MAX_SHOWN]:
        table.add_row(str(fault.bag), fault.place, fault.problem)
    console.print(table)
    more = len(faults) - _MAX_SHOWN
    if more > 0:
        console.print(f"and {more} more; --json has all")
    console.print(f"{plural(len(faults), 'fault')} in {plural(bags, 'bag')}", style="red")
