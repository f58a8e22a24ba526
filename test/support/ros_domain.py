"""The ROS domain of the tests of this process, which no other test run on this machine has."""

import fcntl
import tempfile
from pathlib import Path
from typing import IO

_DOMAINS = range(1, 40)
"""Below those that graphs choose by themselves."""
_held: list[IO[str]] = []


def _reserve() -> int:
    for domain in _DOMAINS:
        try:
            file = Path(tempfile.gettempdir(), f"simbev-tests-domain-{domain}.lock").open("a")  # noqa: SIM115
        except OSError:  # it belongs to another user
            continue
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            file.close()
            continue
        _held.append(file)
        return domain
    raise AssertionError(f"all ROS domains from {_DOMAINS.start} to {_DOMAINS.stop - 1} are in use by tests")


DOMAIN = _reserve()
