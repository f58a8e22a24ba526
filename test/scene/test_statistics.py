import drive_cases
import numpy as np
import pytest

from simbev_ros.scene.drawing.statistics import BINS, Tally, iter_drawn_values


def test_a_tally_of_batches_equals_the_statistics_of_the_whole() -> None:
    values = np.random.default_rng(3).normal(1e3, 2.0, 1_000_000)
    tally = Tally()
    for batch in np.split(values, np.sort(np.random.default_rng(4).integers(1, len(values), 300))):
        if len(batch):
            tally.add(batch)
    assert (tally.count, tally.min, tally.max) == (len(values), values.min(), values.max())
    assert tally.mean == pytest.approx(values.mean(), rel=1e-12)
    assert tally.sd == pytest.approx(values.std(), rel=1e-9)
    shares = np.histogram(values, BINS)[0] / len(values)
    assert tally.shares() == pytest.approx(shares, abs=0.004)  # of a sample of the values
    assert tally.shares().sum() == pytest.approx(1.0)


def test_a_tally_of_one_value_has_no_spread() -> None:
    tally = Tally()
    tally.add(np.full(7, 0.1))
    tally.add(np.full(5, 0.1))
    assert (tally.count, tally.min, tally.max, tally.sd) == (12, 0.1, 0.1, 0.0)


def test_a_route_is_its_length_and_not_its_points() -> None:
    scene = drive_cases.spec()
    assert scene.drive is not None
    found = {name: value for name, value in iter_drawn_values(scene) if name.startswith("drive.")}
    assert found["drive.route_m"] == scene.drive.route.length_m
    assert found["drive.events"] == len(scene.drive.events)
    assert not [name for name in found if name.startswith("drive.route.")]
