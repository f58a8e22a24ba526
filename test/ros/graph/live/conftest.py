"""One live graph, which all tests of this folder share and leave as it was: running."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from commands import Command, leaving_nothing, write_small


@pytest.fixture(scope="package")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Command]:
    """The command of a live graph with a camera, a lidar, a GNSS receiver and an IMU, which has little to do."""
    config = write_small(tmp_path_factory.mktemp("live"), 600, "frames: {odom: true}\n", without=["radar"])
    text = config.read_text()
    less_of = {
        "_s: 1": "_s: 1, tick_s: 0.1",
        "rate_hz: 100": "rate_hz: 20",
        "64, rate_hz: 10": "64, rate_hz: 5",
        ": 15": ": 5",
    }
    for busy, less in less_of.items():
        assert busy in text
        text = text.replace(busy, less)
    config.write_text("".join(line for line in text.splitlines(keepends=True) if "occupancy:" not in line))
    with leaving_nothing(), closing(Command("run", config, "--live")) as command:
        yield command


@pytest.fixture(autouse=True)
def no_leftovers() -> None:
    """The graph runs on after each test; its own fixture checks that it leaves nothing."""
