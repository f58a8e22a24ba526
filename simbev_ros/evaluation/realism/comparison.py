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
        low: The lowest value of a single real sample.
        high: The highest value of a single real sample.
    """

    sensor: str
    figure: str
    ours: float
    real: Mapping[str, float]
    low: float
    high: float

    @property
    def is_inside(self) -> bool:
        """Whether ours lies in the span of the real samples, widened by a tenth of each end."""
        return self.low - 0.1 * abs(self.low) <= self.ours <= self.high + 0.1 * abs(self.high)


def compare(ours: Mapping[str, Sequence[Sample]], real: Mapping[str, Sequence[Sample]]) -> list[Row]:
    """Rows for all sensors of ours for which there are real samples of the same kind."""
    figures_of_real: dict[str, dict[str, Figures]] = {}
    figures_of_each: dict[str, list[Figures]] = {}
    for name, samples in real.items():
        kind = KINDS[type(samples[0])]
        figures_of_real.setdefault(kind, {})[name] = figures_of(samples)
        figures_of_each.setdefault(kind, []).extend(figures_of([sample]) for sample in samples)
    rows = []
    for sensor, samples in ours.items():
        kind = KINDS[type(samples[0])]
        for figure, value in figures_of(samples).items():
            others = figures_of_real.get(kind, {})
            known = {name: figures[figure] for name, figures in others.items() if np.isfinite(figures[figure])}
            span = [*known.values(), *(figures[figure] for figures in figures_of_each.get(kind, []))]
            if known and np.isfinite(value):
                rows.append(Row(sensor, figure, value, known, float(np.nanmin(span)), float(np.nanmax(span))))
    return rows
