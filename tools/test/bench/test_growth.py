import numpy as np
import pytest

from tools.bench.growth import Trend, robust_slope, trends
from tools.bench.resource_use import FilesUse, ProcessUse, ResourceUse

FLAT = {"memory_mib": 300.0, "descriptors": 28.0, "threads": 14.0}


def samples_with(**changes: list[float]) -> list[ResourceUse]:
    """One sample a minute of one process, in which these quantities change."""
    count = len(next(iter(changes.values())))
    values = {name: changes.get(name, [value] * count) for name, value in FLAT.items()}
    files = changes.get("files", [70.0] * count)
    return [
        ResourceUse(
            60.0 * index,
            {"world": ProcessUse(memory_mib, int(descriptors), int(threads))},
            FilesUse(int(files[index]), 900.0),
            FilesUse(14, 0.0),
        )
        for index, (memory_mib, descriptors, threads) in enumerate(zip(*values.values(), strict=True))
    ]


def trend(samples: list[ResourceUse], name: str, quantity: str) -> Trend:
    return next(each for each in trends(samples) if (each.name, each.quantity) == (name, quantity))


def test_a_line_has_its_slope_whatever_a_few_outliers_are() -> None:
    times = np.arange(20.0)
    values = 3.0 + 0.5 * times
    values[[2, 9, 15, 19]] += [400.0, -70.0, 1e6, 50.0]
    assert robust_slope(times, values) == pytest.approx(0.5, abs=0.05)


def test_memory_that_leaks_a_mebibyte_a_minute_grows() -> None:
    found = trend(samples_with(memory_mib=[100.0 + minute for minute in range(31)]), "world", "memory_mib")
    assert found.per_h == pytest.approx(60.0)
    assert (found.start, found.end, found.rise) == (106.0, 130.0, pytest.approx(24.0))
    assert found.grows


def test_memory_that_rises_in_the_first_fifth_alone_does_not_grow() -> None:
    found = trend(samples_with(memory_mib=[100.0 * min(minute, 6) for minute in range(31)]), "world", "memory_mib")
    assert (found.start, found.rise, found.grows) == (600.0, 0.0, False)


def test_memory_that_alternates_between_two_maps_does_not_grow() -> None:
    found = trend(samples_with(memory_mib=[500.0 + 60.0 * (scene % 2) for scene in range(50)]), "world", "memory_mib")
    assert abs(found.rise) < 1.0
    assert not found.grows


@pytest.mark.parametrize("quantity", ["descriptors", "threads"])
def test_one_more_in_each_scene_grows(quantity: str) -> None:
    assert trend(samples_with(**{quantity: [20.0 + scene for scene in range(10)]}), "world", quantity).grows
    assert not trend(samples_with(**{quantity: [20.0 + scene % 3 for scene in range(10)]}), "world", quantity).grows


def test_files_that_are_left_in_shared_memory_grow() -> None:
    samples = samples_with(files=[70.0 + 2 * scene for scene in range(10)])
    assert [each.name for each in trends(samples) if each.grows] == ["/dev/shm"]
