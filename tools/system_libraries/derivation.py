"""Derives which libraries of the system the installed wheels need.

A wheel brings a needed library if the file lies in the object's own search path, in LD_LIBRARY_PATH (which ROS's wheels
set when Python starts), or in a wheel that the object's wheel requires and that is therefore loaded before it.
"""

import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from tools.system_libraries.distributions import DistributionGraph
from tools.system_libraries.linkage import read_linkage

ROOT, EXTRAS = "simbev_ros", ("sim", "wheels")
"""Packages that set-up installs; the table lists their libraries."""

_PROGRAMS = ("sumo/bin/netconvert",)
"""The only programs of wheels that are started."""
_NEVER_LOADED = ("open3d/open3d_torch_ops.so", "open3d/open3d_tf_ops.so")
"""Open3D loads its operators for PyTorch and TensorFlow only on demand."""


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
    """Files that Python imports, opens or starts; the libraries bundled with them follow from these."""
    for path in files:
        is_bundled = path.parent.name.endswith(".libs")
        if path.is_file() and not is_bundled and not path.as_posix().endswith(_NEVER_LOADED):
            yield path
