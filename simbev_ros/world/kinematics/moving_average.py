"""Moving average without phase lag."""

from collections import deque

import numpy as np

from simbev_ros.types import Float64Array


class MovingAverage:
    """Average of the latest values around the middle one, with weights that vanish at both ends."""

    def __init__(self, half_ticks: int) -> None:
        """For ``half_ticks`` values on each side of the middle one."""
        self.half_ticks = half_ticks
        weights = np.hanning(2 * half_ticks + 3)[1:-1]
        self._weights = weights / weights.sum()
        self._values: deque[Float64Array] = deque(maxlen=len(weights))

    def add(self, values: Float64Array) -> None:
        """Add the newest values; before the first call, values are taken as constant."""
        self._values.extend([values] * (1 if self._values else len(self._weights)))

    @property
    def middle(self) -> Float64Array:
        """The values ``half_ticks`` before the newest ones."""
        return self._values[self.half_ticks]

    def average(self) -> Float64Array:
        """The average around the middle; exactly the middle value where nothing changed."""
        middle = self.middle
        return middle + np.tensordot(self._weights, np.stack(self._values) - middle, axes=1)
