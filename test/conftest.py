"""Settings of the process that runs the tests."""

import gc

import pytest

_OBJECTS_BETWEEN_COLLECTIONS = 100_000


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Exclude modules and collected tests from garbage collection, and collect less often than Python's default.

    Otherwise a quarter of the time of tests that build towns passes with scanning these objects again and again.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)
