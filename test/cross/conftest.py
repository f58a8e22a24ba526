"""A small town that tests of several modules look at."""

import pytest
from studio import Studio


@pytest.fixture(scope="session")
def blocks() -> Studio:
    """A town of a few streets with traffic and pedestrians."""
    return Studio("Blocks", 3)
