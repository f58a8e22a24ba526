"""Location of files that are not part of the Python package: in a checkout, or installed by pip or colcon."""

import sysconfig
from pathlib import Path

PACKAGE = "simbev_ros"


def shipped_folder(name: str, member: str) -> Path:
    """Folder next to the Python package in a checkout, and in ``share/simbev_ros`` where it is installed.

    Args:
        name: Name of the folder, such as ``config``.
        member: Path of a file in it, by which the right folder is known.

    Raises:
        FileNotFoundError: The installation is incomplete.
    """
    package_dir = Path(__file__).resolve().parents[2]
    prefixes = [package_dir.parents[depth] for depth in range(min(5, len(package_dir.parents)))]
    candidates = [
        package_dir.parent / name,
        *(prefix / "share" / PACKAGE / name for prefix in prefixes),
        Path(sysconfig.get_path("data")) / "share" / PACKAGE / name,
    ]
    for candidate in candidates:
        if (candidate / member).is_file():
            return candidate
    raise FileNotFoundError(f"the folder {name} of {PACKAGE} is not installed; looked in {candidates}")
