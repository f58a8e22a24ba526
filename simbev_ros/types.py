"""Type aliases for numpy arrays: the alias names the dtype; docstrings give shape, unit and frame."""

from typing import Any

import numpy as np
import numpy.typing as npt

BoolArray = npt.NDArray[np.bool_]
UInt8Array = npt.NDArray[np.uint8]
UInt16Array = npt.NDArray[np.uint16]
UInt32Array = npt.NDArray[np.uint32]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Table = npt.NDArray[np.void]
"""Structured array with one row per actor, signal, point or box; each dtype is documented where it is defined."""
AnyArray = npt.NDArray[Any]
