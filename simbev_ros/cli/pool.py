"""The options ``--workers`` and ``--ray`` of commands that read bags side by side."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal

import typer

from simbev_ros.dataset.parallel import Pool, Processes
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.threads import usable_cores
from simbev_ros.ros.graph.domain import ISOLATED_DOMAINS

MAX_GRAPHS, _MAX_PROCESSES = len(ISOLATED_DOMAINS), 1024

Workers = Annotated[
    str | None,
    typer.Option(help="Number of processes on this machine; auto, the default: number of cores.", metavar="N|auto"),
]
Ray = Annotated[
    str | None,
    typer.Option(
        help="Work on all nodes of this Ray cluster; auto: the one that this machine is a node of.",
        metavar="auto|HOST:PORT",
    ),
]


def worker_count(text: str | None, maximum: int) -> int | Literal["auto"] | None:
    """The value of ``--workers``.

    Raises:
        InputError: It is neither ``auto`` nor a number that is allowed.
    """
    if text is None:
        return None
    if text == "auto":
        return "auto"
    if not (text.isascii() and text.isdecimal() and len(text) <= len(str(maximum)) and 1 <= int(text) <= maximum):
        raise InputError(f"--workers: is {text!r:.80}; allowed: 1 to {maximum}, or auto")
    return int(text)


def processes(workers: str | None) -> Processes:
    """The processes that ``--workers`` asks for.

    Raises:
        InputError: It is neither ``auto`` nor a number that is allowed.
    """
    count = worker_count(workers, _MAX_PROCESSES)
    return Processes(count if isinstance(count, int) else usable_cores())


@contextmanager
def open_pool(
    workers: str | None,
    ray: str | None,
    *,
    module: str,
    memory_mib: int,
    reads: Sequence[Path] = (),
    writes: Sequence[Path] = (),
) -> Iterator[Pool]:
    """Processes on this machine, or the nodes of a cluster, which are checked before anything is written.

    Args:
        workers: Value of ``--workers``.
        ray: Value of ``--ray``.
        module: Name of the module that does the work; nodes must have the same code.
        memory_mib: Memory that the work on one item takes.
        reads: Datasets and bags that all nodes must see.
        writes: Folders that all nodes must be able to write to; they need not exist yet.

    Raises:
        InputError: A value is wrong, or the cluster or one of its nodes cannot be used.
    """
    chosen = processes(workers)
    if ray is None:
        yield chosen
        return
    if workers is not None:
        raise InputError("is for this machine alone; a cluster has as many as there is room for", parameter="workers")
    from simbev_ros.production.cluster import ray_task_pool
    from simbev_ros.production.cluster.node_check import check_nodes
    from simbev_ros.production.cluster.ray_cluster import RayCluster

    with RayCluster(ray, reaps_graphs=False) as cluster:
        check_nodes(cluster, *writes, reads=reads, modules=(module, ray_task_pool.__name__))
        yield ray_task_pool.RayTaskPool(cluster, memory_mib)


def shared_path(path: Path, ray: str | None) -> Path:
    """A path that means the same on all nodes of a cluster, although their working directories differ."""
    return path if ray is None else path.absolute()
