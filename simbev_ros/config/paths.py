"""Location of the shipped configuration files: in a checkout, or installed by pip or colcon."""

from pathlib import Path

from simbev_ros.foundation.installation.shipped_files import shipped_folder


def shipped_config_dir() -> Path:
    """Folder of the shipped configuration files.

    Raises:
        FileNotFoundError: The installation is incomplete.
    """
    return shipped_folder("config", "fastdds.xml")
