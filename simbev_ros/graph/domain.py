"""Reserves a ROS domain for each running graph with a lock file, so that graphs on one machine stay apart."""

import fcntl
import os
import tempfile
from pathlib import Path
from typing import IO, Self

from simbev_ros.errors import InputError

_ISOLATED_DOMAINS = range(41, 101)
"""Domains that are safe with the default port mapping (below 102) and higher than those usually chosen by hand."""


class DomainLock:
    """Holds a ROS domain until it is closed.

    Args:
        wanted: The domain; None: ``ROS_DOMAIN_ID`` if it is set, else the first free domain of a reserved range.

    Raises:
        InputError: The domain is out of range, or another simbev graph runs in it.
    """

    def __init__(self, wanted: int | None = None) -> None:
        if wanted is None and os.environ.get("ROS_DOMAIN_ID"):
            wanted = _domain_from_environment()
        self._file: IO[str] | None = None
        for domain in [wanted] if wanted is not None else _ISOLATED_DOMAINS:
            self._file = _try_lock(domain)
            if self._file is not None:
                self.domain = domain
                return
        if wanted is not None:
            raise InputError(f"ROS domain {wanted} is in use by another simbev graph; set ROS_DOMAIN_ID to another one")
        raise InputError(f"all ROS domains from {_ISOLATED_DOMAINS.start} to {_ISOLATED_DOMAINS.stop - 1} are in use")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the domain for other graphs; further calls do nothing."""
        if self._file is not None:
            self._file.close()
            self._file = None


def _domain_from_environment() -> int:
    text = os.environ["ROS_DOMAIN_ID"]
    if not text.isdecimal() or int(text) > 232:
        raise InputError(f"ROS_DOMAIN_ID: must be a number from 0 to 232, not {text!r}")
    return int(text)


def _try_lock(domain: int) -> IO[str] | None:
    folder = Path(tempfile.gettempdir()) / f"simbev_ros-{os.getuid()}"
    folder.mkdir(mode=0o700, exist_ok=True)
    file = (folder / f"domain-{domain}.lock").open("w")
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        file.close()
        return None
    return file
