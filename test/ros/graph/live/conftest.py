"""One live graph, which all tests of this folder share and leave as it was: running."""

from collections.abc import Iterator
from contextlib import closing

import pytest
from commands import Command, leaving_nothing, write_small


@pytest.fixture(scope="package")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Command]:
    """The command of a live graph with a camera, a lidar, a GNSS receiver and IMUs, and few images per second."""
    config = write_small(tmp_path_factory.mktemp("live"), 600, "frames: {odom: true}\n", without=["radar"])
    config.write_text(config.read_text().replace("height_px: 64, rate_hz: 10", "height_px: 64, rate_hz: 4"))
    with leaving_nothing(), closing(Command("run", config, "--live")) as command:
        yield command


@pytest.fixture(autouse=True)
def no_leftovers() -> None:
    """The graph runs on after each test; its own fixture checks that it leaves nothing."""
