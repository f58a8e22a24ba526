"""simbev_ros: random driving scenes as a ROS 2 graph, with sensors and exact bird's-eye-view ground truth."""

import re
from importlib import metadata
from pathlib import Path


def _read_version() -> str:
    """The version in package.xml: read there in a checkout, else from the metadata that installation made of it."""
    manifest = Path(__file__).parents[1] / "package.xml"
    if manifest.is_file():
        found = re.search("<name>simbev_ros</name>.*?<version>(.*?)</version>", manifest.read_text("utf-8"), re.DOTALL)
        if found:
            return found[1]
    return metadata.version("simbev_ros")


__version__ = _read_version()
