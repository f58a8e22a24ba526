"""Location of the shipped configuration files: in a checkout, or installed by pip or colcon."""

import sysconfig
from pathlib import Path

PACKAGE = "simbev_ros"


def shipped_config_dir() -> Path:
    """Folder of the shipped configuration files.

    Raises:
        FileNotFoundError: The installation is incomplete.
    """
    package_dir = Path(__file__).resolve().parents[1]
    prefixes = [package_dir.parents[depth] for depth in range(min(5, len(package_dir.parents)))]
    candidates = [
        package_dir.parent / "config",
        *(prefix / "share" / PACKAGE / "config" for prefix in prefixes),
        Path(sysconfig.get_path("data")) / "share" / PACKAGE / "config",
    ]
    for candidate in candidates:
        if (candidate / "fastdds.xml").is_file():
            return candidate
    raise FileNotFoundError(f"the configuration files of {PACKAGE} are not installed; looked in {candidates}")
