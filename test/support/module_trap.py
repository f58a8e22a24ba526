"""A folder whose modules betray that they were imported: what a dataset from anywhere may hold."""

import sys
import sysconfig
from pathlib import Path


def set_trap(folder: Path) -> Path:
    """Write a module by the name of each one that Python could import; return the file that says which were."""
    installed = {path.name.removesuffix(".py") for path in Path(sysconfig.get_path("purelib")).iterdir()}
    sprung = folder / "sprung"
    for name in filter(str.isidentifier, installed | sys.stdlib_module_names | {"rclpy", "simbev_ros"}):
        (folder / f"{name}.py").write_text(f"open({str(sprung)!r}, 'a').write(__name__ + ' ')\n")
    return sprung
