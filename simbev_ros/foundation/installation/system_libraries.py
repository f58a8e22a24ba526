"""Derives which libraries of the system the installed wheels need, and finds those that are missing.

A wheel brings a needed library if the file lies in the object's own search path, in LD_LIBRARY_PATH (which ROS's wheels
set when Python starts), or in a wheel that the object's wheel requires and that is therefore loaded before it.
"""

import ctypes
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from simbev_ros.foundation.installation.distributions import DistributionGraph
from simbev_ros.foundation.installation.linkage import read_linkage
from simbev_ros.foundation.tables import load_table

_ROOT, _EXTRAS = "simbev_ros", ("wheels",)
_PROGRAMS = ("sumo/bin/netconvert",)
"""The only programs of wheels that are started."""
_NEVER_LOADED = ("open3d/open3d_torch_ops.so", "open3d/open3d_tf_ops.so")
"""Open3D loads its operators for PyTorch and TensorFlow only on demand."""


class SystemLibrary(NamedTuple):
    """A library that comes from the system.

    Attributes:
        name: As in DT_NEEDED, or as opened at run time.
        package: Its Debian package; None if the table of packages does not know it.
        needed_by: An installed file that needs it.
    """

    name: str
    package: str | None
    needed_by: str


def load_packages() -> dict[str, dict[str, str]]:
    """Load the table of packages: ``linked`` and ``opened``, each library → Debian package."""
    return load_table("simbev_ros.foundation.installation", "system_libraries.yaml")


def find_missing_libraries() -> list[SystemLibrary]:
    """Libraries that the installed wheels need and that the dynamic loader does not find on this machine.

    Raises:
        importlib.metadata.PackageNotFoundError: simbev_ros runs without being installed.
    """
    packages = load_packages()
    needed = derive_needed_libraries(DistributionGraph(_ROOT, _EXTRAS))
    wanted = [
        *(SystemLibrary(name, packages["linked"].get(name), users[0]) for name, users in sorted(needed.items())),
        *(
            SystemLibrary(name, package, "the renderer")
            for name, package in packages["opened"].items()
            if "/" not in name  # Mesa's drivers are on no search path of the loader
        ),
    ]
    return [library for library in wanted if not _is_found(library.name)]


def derive_needed_libraries(graph: DistributionGraph) -> dict[str, list[str]]:
    """Derive which libraries no wheel brings: name → the installed files that need it, shortest path first."""
    owners = graph.find_files(lambda file: ".so" in file.name or file.as_posix().endswith(_PROGRAMS))
    bundled: dict[str, dict[str, Path]] = defaultdict(dict)
    for path, owner in owners.items():
        bundled[owner][path.name] = path
    reachable = {
        owner: {name: path for required in graph.required_by(owner) for name, path in bundled[required].items()}
        for owner in graph.distributions
    }
    library_path = [Path(folder) for folder in os.environ.get("LD_LIBRARY_PATH", "").split(":") if folder]
    needed = defaultdict(set)
    waiting = list(_starts(owners))
    seen = set(waiting)
    while waiting:
        path = waiting.pop()
        linkage = read_linkage(path)
        if linkage is None:
            continue
        for name in linkage.needed:
            candidates = (folder / name for folder in (*linkage.search_path, *library_path))
            found = next((path for path in candidates if path.is_file()), None)
            found = found.resolve() if found else reachable[owners[path]].get(name)
            if found not in owners:
                needed[name].add(str(path))
            elif found not in seen:
                seen.add(found)
                waiting.append(found)
    return {name: sorted(users, key=lambda user: (len(user), user)) for name, users in needed.items()}


def _starts(files: Iterable[Path]) -> Iterator[Path]:
    """Files that Python imports, opens or starts; the libraries bundled beside them follow from these."""
    for path in files:
        is_bundled = path.parent.name.endswith(".libs")
        if path.is_file() and not is_bundled and not path.as_posix().endswith(_NEVER_LOADED):
            yield path


def _is_found(name: str) -> bool:
    try:
        ctypes.CDLL(name)
    except OSError:
        return False
    return True
