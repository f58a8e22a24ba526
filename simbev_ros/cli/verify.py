"""``simbev verify``: checks that bags and datasets are complete and undamaged."""

import json
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.table import Table

from simbev_ros.cli.console import counting_bar, make_console
from simbev_ros.cli.pool import Ray, Workers, open_pool, shared_path
from simbev_ros.dataset.parallel import Pool
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.input_file import path_exists
from simbev_ros.foundation.object_store.object_path import AnyPath, ObjectPath, path_or_url
from simbev_ros.recording.layout import is_dataset, scenes_of

if TYPE_CHECKING:
    from simbev_ros.recording.verify import Fault

_MAX_SHOWN, _MEMORY_MIB = 200, 512
_Bag = tuple[AnyPath, dict[str, Any] | None]
"""A bag, and its row of the index if it is in an object store."""


def verify(
    paths: Annotated[
        list[str],
        typer.Argument(
            help="Scenes' bags, their .mcap files, or datasets; also as s3://bucket/prefix.", metavar="PATHS"
        ),
    ],
    workers: Workers = None,
    ray: Ray = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of a table.")] = False,
) -> None:
    """Read every byte and check checksums, indexes, types, payloads, stamps, and the completeness of scenes.

    The exit code is 1 if anything is wrong.

    [bold]Examples[/]

    simbev verify out/demo

    simbev verify datasets/first datasets/second --json

    simbev verify s3://bucket/datasets/first --ray auto
    """
    from simbev_ros.dataset.check import dataset_faults, plan_faults

    found = [shared_path(path, ray) if isinstance(path, Path) else path for path in map(path_or_url, paths)]
    local = [path for path in found if isinstance(path, Path)]
    for missing in (path for path in local if not path_exists(path)):
        raise InputError(f"{missing}: no such file or folder")
    datasets = [path for path in found if is_dataset(path)]
    bags = [bag for path in found for bag in (_bags_of(path) if path in datasets else [(path, None)])]
    with open_pool(workers, ray, module=__name__, memory_mib=_MEMORY_MIB, reads=local) as pool:
        faults = _faults(bags, pool, is_remote=ray is not None)
        for path in datasets:
            faults += plan_faults(path) if isinstance(path, ObjectPath) else dataset_faults(path, pool)
    if not bags and not faults:
        raise InputError(f"{', '.join(map(str, paths))}: there is no scene to verify")
    if as_json:
        print(json.dumps({"bags": len(bags), "faults": [_plain(fault) for fault in faults]}, indent=2))
    else:
        _print(len(bags), faults)
    raise typer.Exit(1 if faults else 0)


def _bags_of(dataset: AnyPath) -> list[_Bag]:
    """Bags of a dataset; in an object store, with their rows of the index."""
    from simbev_ros.dataset.index import indexed_bags

    return (
        [*indexed_bags(dataset).items()] if isinstance(dataset, ObjectPath) else [(b, None) for b in scenes_of(dataset)]
    )


def _verify(bag: _Bag, temporary: Path | None) -> "list[Fault]":
    from simbev_ros.dataset.fetched_check import verify_fetched_bag
    from simbev_ros.recording.verify import verify_bag

    path, row = bag
    return verify_fetched_bag(path, row, temporary) if isinstance(path, ObjectPath) else verify_bag(path)


def _faults(bags: Sequence[_Bag], pool: Pool, *, is_remote: bool) -> "list[Fault]":
    """The faults of all bags, in the order of the bags, which are read in parallel."""
    faults: list[Fault] = []
    temporary = nullcontext() if is_remote else _temporary_folder(bags)  # nodes have temporary folders of their own
    with temporary as folder, counting_bar("bags", make_console(stderr=True), len(bags)) as bar:
        for found in pool.map(partial(_verify, temporary=folder), bags):
            faults += found
            bar.advance()
    return faults


@contextmanager
def _temporary_folder(bags: Sequence[_Bag]) -> Iterator[Path | None]:
    """A folder for downloads, which outlives interrupted processes; None if all bags are local."""
    if not any(isinstance(path, ObjectPath) for path, _ in bags):
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="simbev_verify_", ignore_cleanup_errors=True) as folder:
        yield Path(folder)


def _plain(fault: "Fault") -> dict[str, str]:
    return {"bag": str(fault.bag), "place": fault.place, "problem": fault.problem}


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
