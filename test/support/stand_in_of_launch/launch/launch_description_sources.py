"""Launch files as sources of descriptions."""

import importlib.util
from pathlib import Path

from launch import LaunchDescription


class PythonLaunchDescriptionSource:
    """A launch file in Python."""

    def __init__(self, launch_file_path: str) -> None:
        assert isinstance(launch_file_path, str)
        self._path = Path(launch_file_path)

    def load(self) -> LaunchDescription:
        """Import the file, and take what its function gives."""
        spec = importlib.util.spec_from_file_location(self._path.name.replace(".", "_"), self._path)
        assert spec is not None and spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        description = module.generate_launch_description()
        assert isinstance(description, LaunchDescription)
        return description
