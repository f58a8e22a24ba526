"""A lock on a folder of an object store, which keeps a second process from writing into it."""

import json
import os
import secrets
import socket
import threading
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Self

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.object_store.connection import StoreConflict
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_objects, get_bytes, put_bytes
from simbev_ros.foundation.units import NS_PER_S

if TYPE_CHECKING:
    from obstore import PutMode

LOCK_NAME = ".lock"
_PROBE_PREFIX = f"{LOCK_NAME}."
_RENEWAL_S = 10.0
_EXPIRY_S = 60.0
"""Age from which the lock of a process that does not renew it is free."""


class ObjectLock:
    """Context manager that a process holds while it writes into a folder.

    The object ``.lock`` names host, process and time. It is a lease: a thread renews it every 10 s, and it expires 60 s
    after the last renewal by the store's clock. A clean end leaves it empty.

    Each write of the object is conditional on the one that was read before, so of several processes exactly one gets
    the lock, and one that was paused or cut off for a minute learns from ``renew`` or ``require`` that it has lost it.
    The store cannot check the lock and write another object in one step. So a process that is paused right between
    ``require`` and its next request, and for a minute, still makes that request when it continues.

    Args:
        folder: The folder, which need not exist.

    Raises:
        InputError: Another process holds the lock, or the store cannot be reached or refuses to write.
    """

    def __init__(self, folder: ObjectPath) -> None:
        self._folder, self._path = folder, folder / LOCK_NAME
        self._token, self._turn = secrets.token_hex(8), threading.Lock()
        now_ns, (holder, before) = require_writable_store(folder), self._read()
        if holder and (silent_s := (now_ns - self._path.stat().st_mtime_ns) / NS_PER_S) < _EXPIRY_S:
            raise InputError(
                f"{folder}: {_describe(holder)} is writing into it; its last heartbeat is {max(silent_s, 0):.0f} s "
                f"old, and after {_EXPIRY_S:.0f} s without one the dataset is free"
            )
        self._tag = before
        if not self.renew():
            raise InputError(f"{folder}: {_describe(self._read()[0])} has begun to write into it at the same time")
        delete_objects(folder.glob(f"{_PROBE_PREFIX}*"))  # of a process that was killed
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="lock", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        with suppress(InputError):  # it has been lost, or expires in a minute
            put_bytes(b"", self._path, self._condition())

    def renew(self) -> bool:
        """Renew the lease; return False if another process has taken the lock.

        Raises:
            StoreError: The store cannot be reached or refuses access.
        """
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        content = {"host": socket.gethostname(), "pid": os.getpid(), "time": now, "token": self._token}
        with self._turn:
            try:
                self._tag = put_bytes(json.dumps(content).encode(), self._path, self._condition())
            except StoreConflict:
                holder, tag = self._read()
                if holder.get("token") != self._token:
                    return False
                self._tag = tag  # the answer to an earlier request was lost
        return True

    def require(self) -> None:
        """Renew the lease.

        Raises:
            InputError: Another process has taken the lock, or the store cannot be reached or refuses access.
        """
        if not self.renew():
            raise InputError(f"{self._folder}: {_describe(self._read()[0])} has taken over; this process stops")

    def _condition(self) -> "PutMode":
        """The object must be the one that was read or written last; without a tag, there must be none."""
        return {"e_tag": self._tag} if self._tag else "create"

    def _keep(self) -> None:
        """Renew the lease until the end; errors are left to those who require the lock."""
        while not self._is_over.wait(_RENEWAL_S):
            with suppress(InputError):
                if not self.renew():
                    return

    def _read(self) -> tuple[dict[str, object], str]:
        """Content of the lock, empty if it is free, and its entity tag, empty without an object."""
        try:
            data, tag = get_bytes(self._path)
        except FileNotFoundError:
            return {}, ""
        try:
            content = parse_json(data or b"{}")
        except ValueError:
            content = None
        return content if isinstance(content, dict) else {"pid": "unknown"}, tag


def require_writable_store(folder: ObjectPath) -> int:
    """Check that objects can be written into a folder and deleted, by an object that is deleted at once.

    Returns:
        Time of the store's clock, ns since 1970.

    Raises:
        InputError: The store cannot be reached, there is no such bucket, access is refused, or another process begins
            to write into the folder at the same time.
    """
    probe = folder / f"{_PROBE_PREFIX}{secrets.token_hex(8)}"
    put_bytes(b"", probe)
    try:
        now_ns = probe.stat().st_mtime_ns
    except FileNotFoundError:
        raise InputError(f"{folder}: another process has begun to write into it at the same time") from None
    delete_objects([probe])
    return now_ns


def _describe(holder: dict[str, object]) -> str:
    known = {key: " ".join(f"{value:.100}".split()) for key, value in holder.items() if isinstance(value, str)}
    pid = value if isinstance(value := holder.get("pid"), int) else known.get("pid") or "unknown"
    return f"process {pid!s:.20} on {known.get('host') or 'an unknown host'}"
