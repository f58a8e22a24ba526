"""Tables of this package: YAML files next to the modules that read them."""

from importlib.resources import files
from typing import Any

import yaml

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # the same values, many times faster


def load_table(package: str, name: str) -> Any:
    """Read a YAML file of a package.

    Args:
        package: Full name of the package, such as ``simbev_ros.scene``.
        name: Name of the file, below the package's folder.
    """
    return yaml.load(files(package).joinpath(name).read_text(encoding="utf-8"), Loader=_LOADER)
