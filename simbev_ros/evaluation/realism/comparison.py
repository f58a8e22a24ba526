"""Puts the figures of simulated sensors beside those of real ones."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from simbev_ros.evaluation.realism.samples import LidarTurn, Photograph, RadarScan, Sample
from simbev_ros.evaluation.realism.statistics import Figures, figures_of

KINDS: Mapping[type, str] = {LidarTurn: "lidar", Photograph: "camera", RadarScan: "radar"}


class Row(NamedTuple):
    """One figure of a sensor of ours beside the real sensors' of its kind.

    Attributes:
        sensor: Name of the sensor.
        figure: Name of the figure, with its unit.
        ours: Its value.
        real: The values of the real sensors by name.
    """

    sensor: str
    figure: str
    ours: float
    real: Mapping[str, float]

    @property
    def low(self) -> float:
        """The lowest value of a real sensor."""
        return min(self.real.values())

    @property
    def high(self) -> float:
        """The highest value of a real sensor."""
        return max(self.real.values())

    @property
    def is_inside(self) -> bool:
        """Whether ours lies in the span of the real ones, widened by a tenth of each end."""
        return self.low - 0.1 * abs(self.low) <= self.ours <= self.high + 0.1 * abs(self.high)


def compare(ours: Mapping[str, Sequence[Sample]], real: Mapping[str, Sequence[Sample]]) -> list[Row]:
    """Rows for all sensors of ours for which there are real samples of the same kind."""
    figures_of_real: dict[str, dict[str, Figures]] = {}
    for name, samples in real.items():
        figures_of_real.setdefault(KINDS[type(samples[0])], {})[name] = figures_of(samples)
    rows = []
    for sensor, samples in ours.items():
        others = figures_of_real.get(KINDS[type(samples[0])], {})
        for figure, value in figures_of(samples).items():
            known = {name: figures[figure] for name, figures in others.items() if np.isfinite(figures[figure])}
            if known and np.isfinite(value):
                rows.append(Row(sensor, figure, value, known))
    return rows
