"""Settings of the process that runs the tests."""

import gc
import os
from collections.abc import Iterator

import pytest
import retry_failed
from store_server import StoreServer, running_store

_OBJECTS_BETWEEN_COLLECTIONS = 100_000
_FILES_BETWEEN_COLLECTIONS = 10
_STARTED_FILES: set[str] = set()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option of continuous integration."""
    parser.addoption("--retry-failed", action="store_true", help="run a failed test once more; list it as flaky")


def pytest_configure(config: pytest.Config) -> None:
    """Load the plugin that the option asks for."""
    if config.getoption("--retry-failed"):
        config.pluginmanager.register(retry_failed)


@pytest.hookimpl(trylast=True)
def pytest_collection_finish() -> None:
    """Exclude modules and collected tests from garbage collection, and collect less often than Python's default.

    Otherwise a quarter of the time of tests that build towns passes with scanning these objects again and again.
    """
    _freeze()
    gc.set_threshold(_OBJECTS_BETWEEN_COLLECTIONS)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_logstart(nodeid: str, location: tuple[str, int | None, str]) -> None:
    """From time to time, exclude also what the tests of earlier files have left, such as caches of maps."""
    if location[0] not in _STARTED_FILES:
        _STARTED_FILES.add(location[0])
        if len(_STARTED_FILES) % _FILES_BETWEEN_COLLECTIONS == 0:
            _freeze()


def _freeze() -> None:
    gc.collect()
    gc.freeze()


@pytest.fixture(autouse=True)
def _modules_of_current_folders() -> Iterator[None]:
    """Undo what a command that ran in this process has set for its children."""
    os.environ.pop("PYTHONSAFEPATH", None)
    yield
    os.environ.pop("PYTHONSAFEPATH", None)


@pytest.fixture(scope="session")
def store_server() -> Iterator[StoreServer]:
    """The S3 server of the test session."""
    with running_store() as server:
        yield server


@pytest.fixture
def store(store_server: StoreServer, monkeypatch: pytest.MonkeyPatch) -> StoreServer:
    """An S3 server with an empty bucket, to which the environment leads."""
    for name in [name for name in os.environ if name.startswith("AWS_")]:
        monkeypatch.delenv(name)
    monkeypatch.setenv("AWS_ENDPOINT_URL_S3", store_server.url)
    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "key")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("AWS_CONFIG_FILE", os.devnull)
    monkeypatch.setenv("AWS_SHARED_CREDENTIALS_FILE", os.devnull)
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    store_server.make_bucket()
    return store_server
