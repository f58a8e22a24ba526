"""Checks that the nodes of a cluster give the same results as this machine, and see the same files."""

import importlib
import os
import secrets
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Self

from simbev_ros import __version__
from simbev_ros.foundation.cache.fingerprint import fingerprint_inputs
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import nearest_existing, write_errors
from simbev_ros.production.cluster.ray_cluster import RayCluster


@dataclass(frozen=True, slots=True)
class Code:
    """The code on a machine that decides about results.

    Attributes:
        version: Version of this package.
        inputs: See ``fingerprint_inputs``.
    """

    version: str
    inputs: Mapping[str, bytes]

    @classmethod
    def here(cls, modules: Sequence[str] = ()) -> Self:
        """The code here that decides about the results of modules; without any, about the bytes of a scene."""
        return cls(__version__, _inputs(tuple(modules)))

    def difference(self, machine: "Code") -> str | None:
        """How the code on a node differs from that on the driver's machine; None: it does not."""
        if self.version != machine.version:
            return f"has simbev_ros {self.version}, this machine {machine.version}"
        there, here = self.inputs, machine.inputs
        differing = sorted(name for name in here.keys() | there.keys() if here.get(name) != there.get(name))
        if not differing:
            return None
        return f"{_describe_difference(differing[0], here, there)}; all nodes need the same code"


@dataclass(frozen=True, slots=True)
class _Sample:
    """A bag's file by which a node shows that it sees what this machine reads.

    Attributes:
        shared: Folder or file that all nodes must see.
        file: The sample, in the folder.
        size: Its size in bytes.
    """

    shared: str
    file: str
    size: int

    @classmethod
    def of(cls, shared: Path) -> Self:
        """Choose a sample; of a folder without bags, the folder itself."""
        shared = shared.absolute()
        file = next(shared.rglob("*.mcap"), shared)
        return cls(str(shared), str(file), file.stat().st_size if file.is_file() else 0)

    def problem(self) -> str | None:
        """Runs on a node: why it does not see the sample; None: it does."""
        file = Path(self.file)
        if file.exists() and (not file.is_file() or file.stat().st_size == self.size):
            return None
        return f"does not see {self.shared} as this machine does; all nodes must see it"


def check_nodes(cluster: RayCluster, *folders: Path, reads: Sequence[Path] = (), modules: Sequence[str] = ()) -> None:
    """Check that each node that has CPUs runs the same code and can use the shared folders.

    Args:
        cluster: The cluster.
        folders: The folders that all nodes write to; of those that do not exist yet, the nearest ones above.
        reads: Datasets and bags that exist, and that all nodes read.
        modules: Names of the modules whose code matters; none: those that make scenes.

    Raises:
        InputError: One of them does not; the message names it.
    """
    with ExitStack() as held:
        probes = [str(held.enter_context(_probe(folder))) for folder in folders]
        question = (Code.here(modules), tuple(modules), probes, [*map(_Sample.of, reads)])
        for node, problem in cluster.ask_nodes(node_problem, *question):
            if problem is not None:
                raise InputError(f"{node.label}: {problem}")


def node_problem(
    driver: Code, modules: Sequence[str] = (), probes: Sequence[str] = (), samples: Sequence[_Sample] = ()
) -> str | None:
    """Runs on a node: why it would give other results than the driver's machine, or cannot use what is shared.

    Args:
        driver: The code on the driver's machine.
        modules: Names of the modules whose code matters; none: those that make scenes.
        probes: Files that the driver has made in the folders that all nodes write to.
        samples: Samples of what all nodes read.
    """
    found = [Code.here(modules).difference(driver)]
    found += [_folder_problem(Path(probe)) for probe in probes]
    found += [sample.problem() for sample in samples]
    return next((problem for problem in found if problem is not None), None)


def _folder_problem(probe: Path) -> str | None:
    """Why a node cannot use the folder of a probe; None: it can."""
    if not probe.is_file():
        return f"does not see the folder {probe.parent}; a dataset must be in a folder that all nodes see"
    return None if os.access(probe.parent, os.W_OK) else f"cannot write to {probe.parent}"


@contextmanager
def _probe(folder: Path) -> Iterator[Path]:
    """Make a file in a folder for as long as the context is open."""
    path = nearest_existing(folder.absolute()) / f".probe-{secrets.token_hex(4)}"
    with write_errors(folder):
        path.touch()
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


@cache
def _inputs(modules: tuple[str, ...]) -> dict[str, bytes]:
    """All code on this machine that decides about the results of modules, or without any about the bytes of a scene."""
    if modules:
        return fingerprint_inputs(*modules)
    nodes = importlib.import_module("simbev_ros.ros.nodes.main").KINDS  # loads ROS
    return fingerprint_inputs(
        "simbev_ros.production.scene_maker", *(f"simbev_ros.ros.nodes.{kind}_node" for kind in nodes)
    )


def _describe_difference(name: str, here: Mapping[str, bytes], there: Mapping[str, bytes]) -> str:
    """How a part of the code differs on a node."""
    versions = there.get(name), here.get(name)
    if name.startswith(("module ", "data ")):
        return f"{name} differs" if all(versions) else f"{name} is {'not there' if versions[1] else 'not here'}"
    return f"has {name} {', this machine '.join('not at all' if v is None else v.decode() for v in versions)}"
