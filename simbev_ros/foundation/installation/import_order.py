"""Puts the packages of this installation before those of PYTHONPATH, where shells of ROS users have other versions.

``python -P -m simbev_ros.foundation.installation.import_order MODULE ARGUMENT …`` runs a module in this order. It
imports nothing but the standard library.
"""

import os
import runpy
import sys
import sysconfig
from pathlib import Path


def put_own_packages_first() -> None:
    """Move the folders of PYTHONPATH, which may hold a workspace's message packages, to the end of ``sys.path``."""
    if path := os.environ.get("PYTHONPATH"):
        own = {Path(folder).resolve() for folder in sysconfig.get_paths().values()}
        foreign = {Path(folder).resolve() for folder in path.split(os.pathsep)} - own
        sys.path.sort(key=lambda folder: Path(folder).resolve() in foreign)


def module_command(module: str, *arguments: str) -> tuple[str, ...]:
    """Command that runs a module of ours in this order, and takes none from the current folder."""
    return (sys.executable, "-P", "-m", __name__, module, *arguments)


if __name__ == "__main__":
    put_own_packages_first()
    del sys.argv[0]
    runpy.run_module(sys.argv[0], run_name="__main__", alter_sys=True)
