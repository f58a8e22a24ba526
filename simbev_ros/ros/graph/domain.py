"""Reserves a namespace of a ROS domain for each running graph with a lock file, so that graphs stay apart."""

import os
import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

from simbev_ros.foundation.errors import GraphError, InputError
from simbev_ros.foundation.files.lock_file import lock_file, open_lock_file
from simbev_ros.foundation.files.private_folder import is_private_folder

ISOLATED_DOMAINS = range(41, 101)
"""Domains that are safe with the default port mapping (below 102) and higher than those usually chosen by hand."""


class DomainLock:
    """Holds a namespace of a ROS domain until it is closed.

    Args:
        wanted: The domain; None: ``ROS_DOMAIN_ID`` if it is set, else the first free domain of a reserved range.
        namespace: The graph's namespace; empty: it has none.

    Raises:
        GraphError: All domains of the range are in use.
        InputError: The domain is out of range, another simbev graph runs there, or the folder of lock files is not
            this user's alone.
    """

    def __init__(self, wanted: int | None = None, namespace: str = "") -> None:
        if wanted is None and os.environ.get("ROS_DOMAIN_ID"):
            wanted = domain_from_environment()
        self._descriptor: int | None = None
        for domain in [wanted] if wanted is not None else ISOLATED_DOMAINS:
            self._descriptor = _try_lock(domain, namespace)
            if self._descriptor is not None:
                self.domain = domain
                return
        if wanted is not None:
            place = f"ROS domain {wanted}" if not namespace else f"namespace {namespace} of ROS domain {wanted}"
            remedy = "set ROS_DOMAIN_ID to another one, or give the graph a namespace of its own"
            raise InputError(f"{place} is in use by another simbev graph; {remedy}")
        raise GraphError(f"all ROS domains from {ISOLATED_DOMAINS.start} to {ISOLATED_DOMAINS.stop - 1} are in use")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the domain for other graphs; further calls do nothing."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None


def domain_from_environment() -> int:
    """The domain that ``ROS_DOMAIN_ID`` names; 0 if it is not set.

    Raises:
        InputError: It is not a domain.
    """
    text = os.environ.get("ROS_DOMAIN_ID") or "0"
    if not re.fullmatch(r"[0-9]{1,3}", text) or int(text) > 232:
        raise InputError(f"ROS_DOMAIN_ID: must be a number from 0 to 232, not {text!r:.80}")
    return int(text)


def _try_lock(domain: int, namespace: str) -> int | None:
    """Descriptor of the locked file of a namespace in a domain; None if another process has locked it."""
    name = f"domain-{domain}{namespace.replace('/', '.')}.lock"  # no name in ROS has a dot
    with _lock_folder() as folder:
        descriptor = open_lock_file(Path(name), folder)
    try:
        lock_file(descriptor)
    except BlockingIOError:
        os.close(descriptor)
        return None
    return descriptor


@contextmanager
def _lock_folder() -> Iterator[int]:
    """Descriptor of this user's folder of lock files.

    Raises:
        InputError: It cannot be used, or another user could write to it.
    """
    path = Path(tempfile.gettempdir()) / f"simbev_ros-{os.getuid()}"
    remedy = "remove it, or set TMPDIR to a folder of your own"
    try:
        with suppress(FileExistsError):
            path.mkdir(mode=0o700)
        descriptor = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError as error:
        raise InputError(f"{path}: cannot hold locks of ROS domains: {error.strerror}; {remedy}") from None
    try:
        if not is_private_folder(os.fstat(descriptor)):
            raise InputError(f"{path}: another user owns it or may write to it; {remedy}")
        yield descriptor
    except OSError as error:
        raise InputError(f"{path}: cannot hold locks of ROS domains: {error.strerror}; {remedy}") from None
    finally:
        os.close(descriptor)
