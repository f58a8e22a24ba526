"""Arrays with rows for each rigid part of each actor model, such as its outermost points, made on demand."""

from collections.abc import Callable, Sequence

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.foundation.geometry.ragged import ragged_indices, ragged_starts
from simbev_ros.foundation.types import AnyArray, Float32Array, Int64Array


class PartRows:
    """Rows of one array that belong to the parts of models; those of a model are made when it is first used.

    Attributes:
        values: (V, …) float32 rows of all models that were used.
        count: (P,) number of rows of each part, numbered through all models as in ``Skeletons``; 0 if not made yet.
    """

    def __init__(
        self, models: Sequence[ActorModel], make: Callable[[ActorModel], Sequence[Float32Array]], shape: tuple[int, ...]
    ) -> None:
        """Prepare models, indexed by blueprint; ``make`` returns the rows of each part, which have this shape."""
        self._models, self._make = models, make
        parts = np.array([len(model.parts) for model in models], np.int64)
        self._first_part, self._is_made = ragged_starts(parts), np.zeros(len(models), bool)
        self._first, self.count = np.zeros((2, int(parts.sum())), np.int64)
        self.values: Float32Array = np.empty((0, *shape), np.float32)

    def prepare(self, blueprints: AnyArray) -> None:
        """Make the rows of those of (N,) blueprints that are used for the first time."""
        made = [self.values]
        for blueprint in np.unique(blueprints[~self._is_made[blueprints]]).tolist():
            parts = self._make(self._models[blueprint])
            own = slice(self._first_part[blueprint], self._first_part[blueprint] + len(parts))
            self.count[own] = [len(rows) for rows in parts]
            self._first[own] = sum(map(len, made)) + ragged_starts(self.count[own])
            self._is_made[blueprint] = True
            made += parts
        if len(made) > 1:
            self.values = np.concatenate(made)

    def indices(self, parts: Int64Array) -> Int64Array:
        """Index into ``values`` of each row of (R,) parts, part by part."""
        part, offset = ragged_indices(self.count[parts])
        return self._first[parts][part] + offset
