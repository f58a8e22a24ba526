"""Type aliases for numpy arrays: the alias names the dtype; docstrings give shape, unit and frame."""

from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

BoolArray = npt.NDArray[np.bool_]
UInt8Array = npt.NDArray[np.uint8]
Int16Array = npt.NDArray[np.int16]
UInt16Array = npt.NDArray[np.uint16]
UInt32Array = npt.NDArray[np.uint32]
Int32Array = npt.NDArray[np.int32]
Int64Array = npt.NDArray[np.int64]
Float32Array = npt.NDArray[np.float32]
Float64Array = npt.NDArray[np.float64]
Table: TypeAlias = Any
"""Structured array with one row per actor, signal, point or box; each dtype is documented where it is defined.

With NDArray[np.void], fields would be arrays of Any all the same, and mypy would take twice as long.
"""
AnyArray = npt.NDArray[Any]
