"""Loads the compiled core of Open3D without the Python package around it.

``import open3d`` also imports plotly, dash and IPython for plots in notebooks, which takes a third of its import time
and memory in every process that casts rays. Open3D has no option to avoid that, so its extension module is imported
here below an empty package of the same name. This relies only on the module name ``open3d.pybind``, which Open3D's own
``__init__`` imports first. A later ``import open3d`` finds the same extension module and completes the package.
"""

import importlib
import importlib.util
import sys
from types import ModuleType

_PACKAGE = "open3d"
_CORE = f"{_PACKAGE}.pybind"


def load_open3d_core() -> ModuleType:
    """Return Open3D's extension module, with ``core`` and ``t`` as in ``open3d`` itself.

    Raises:
        ImportError: Neither ``open3d-cpu`` nor ``open3d`` 0.20 or newer is installed, or a system library that it
            needs is missing.
    """
    if _PACKAGE in sys.modules:
        return importlib.import_module(_CORE)
    spec = importlib.util.find_spec(_PACKAGE)
    if spec is None:
        raise ImportError("neither open3d-cpu nor open3d is installed", name=_PACKAGE)
    sys.modules[_PACKAGE] = importlib.util.module_from_spec(spec)
    try:
        return importlib.import_module(_CORE)
    finally:
        del sys.modules[_PACKAGE]
