"""Who stands where: each object claims its footprint, and none may overlap one claimed before."""

import numpy as np
from shapely.geometry.base import BaseGeometry

from simbev_ros.types import Float64Array


class Claims:
    """Footprints in plan, map frame, metres."""

    def __init__(self) -> None:
        self._footprints: list[BaseGeometry] = []
        self._bounds: Float64Array = np.empty((1024, 4))

    def is_free(self, footprint: BaseGeometry) -> bool:
        """Whether nothing claimed overlaps or touches it."""
        bounds, own = self._bounds[: len(self._footprints)], footprint.bounds
        near = (bounds[:, 0] <= own[2]) & (bounds[:, 2] >= own[0]) & (bounds[:, 1] <= own[3]) & (bounds[:, 3] >= own[1])
        return not any(self._footprints[k].intersects(footprint) for k in np.flatnonzero(near))

    def add(self, footprint: BaseGeometry) -> None:
        """Claim unasked."""
        count = len(self._footprints)
        if count == len(self._bounds):
            self._bounds = np.concatenate([self._bounds, np.empty_like(self._bounds)])
        self._bounds[count] = footprint.bounds
        self._footprints.append(footprint)

    def claim(self, footprint: BaseGeometry) -> bool:
        """Claim it if it is free, and say whether it was."""
        free = self.is_free(footprint)
        if free:
            self.add(footprint)
        return free
