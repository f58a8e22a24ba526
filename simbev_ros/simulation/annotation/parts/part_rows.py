"""Rows for each rigid part of each actor model, such as its outermost points; those of the catalog are cached."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.foundation.cache.entries import default_cache_dir, entry_path
from simbev_ros.foundation.cache.files import read_cached
from simbev_ros.foundation.cache.fingerprint import fingerprint
from simbev_ros.foundation.files.mapped_arrays import map_arrays, write_arrays
from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts
from simbev_ros.foundation.types import AnyArray, Float32Array, Int64Array
from simbev_ros.scene.blueprints import load_blueprints
from simbev_ros.simulation.annotation.parts.blocks import block_bounds, blocks
from simbev_ros.simulation.annotation.parts.outermost import outermost_points

_KIND = "parts"
_Make = Callable[[ActorModel], Sequence[Float32Array]]
_CACHED: tuple[_Make, ...] = (blocks, block_bounds, outermost_points)
"""All that is made, so that the fingerprint of this module covers it."""


class PartRows:
    """Rows of one array that belong to the parts of models.

    Attributes:
        values: (V, …) float32 rows of all parts of all models.
        count: (P,) number of rows of each part, numbered through all models as in ``Skeletons``.
    """

    def __init__(self, models: Sequence[ActorModel], make: _Make) -> None:
        """Make the rows of models, indexed by blueprint.

        Args:
            models: At least one model. Processes share the arrays of the whole catalog, which are made only once.
            make: Returns the rows of each part of a model; one of the functions of this package.
        """
        is_catalog = make in _CACHED and len(models) == len(load_blueprints()) and models is load_models()
        arrays = _cached(make) if is_catalog else _arrays(models, make)
        self.values, self.count = arrays["values"], arrays["count"]
        self._first = ragged_starts(self.count)

    def indices(self, parts: Int64Array) -> Int64Array:
        """Index into ``values`` of each row of (R,) parts, part by part."""
        part, offset = ragged_indices(self.count[parts])
        return self._first[parts][part] + offset


def _arrays(models: Sequence[ActorModel], make: _Make) -> dict[str, AnyArray]:
    rows = [rows for model in models for rows in make(model)]
    return {"values": np.concatenate(rows), "count": np.array([len(each) for each in rows])}


def _cached(make: _Make) -> dict[str, AnyArray]:
    """The arrays of the catalog's models."""

    def write(path: Path) -> None:
        write_arrays(path, _arrays(load_models(), make))

    path = entry_path(default_cache_dir() / _KIND, make.__name__, fingerprint(__name__), make.__name__.encode())
    return read_cached(path / "rows.npz", _KIND, map_arrays, write)
