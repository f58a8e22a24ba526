"""A lock on a folder of an object store, which keeps a second process from writing into it."""

import json
import os
import secrets
import socket
import threading
import time
from contextlib import suppress
from typing import Self

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.connection import connection, store_errors
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import put_bytes
from simbev_ros.foundation.units import NS_PER_S

LOCK_NAME = ".lock"
_PROBE_PREFIX = f"{LOCK_NAME}."
_REFRESH_S = 10.0
_EXPIRY_S = 60.0
"""Age from which the lock of a process that does not refresh it is free."""
_MAX_BYTES = 1 << 12


class ObjectLock:
    """Context manager that a process holds while it writes into a folder.

    The object ``.lock`` names host, process and time. A thread writes it again every 10 s. It is free when it is empty,
    as a clean end leaves it, or older than 60 s by the store's clock.

    Of two processes, the later one is refused, unless both begin within the same fraction of a second, or the first one
    is paused or cut off from the store for a minute. Then the lock belongs to the one that wrote it last, and
    ``require`` ends the other. The store cannot check the lock and write another object in one step. So a process that
    is paused right between ``require`` and its next request still makes that request when it continues.

    Args:
        folder: The folder, which need not exist.

    Raises:
        InputError: Another process holds the lock, or the store cannot be reached or refuses to write.
    """

    def __init__(self, folder: ObjectPath) -> None:
        self._folder, self._path = folder, folder / LOCK_NAME
        self._token = secrets.token_hex(8)
        holder = self._read()
        now_ns = require_writable_store(folder)
        if holder and (silent_s := (now_ns - self._path.stat().st_mtime_ns) / NS_PER_S) < _EXPIRY_S:
            raise InputError(
                f"{folder}: {_describe(holder)} is writing into it; its last sign of life is {max(silent_s, 0):.0f} s "
                f"old, and after {_EXPIRY_S:.0f} s without one the dataset is free"
            )
        self._write()
        for probe in folder.glob(f"{_PROBE_PREFIX}*"):  # of a process that was killed
            _delete(probe)
        self._is_over = threading.Event()
        self._thread = threading.Thread(target=self._refresh, name="lock", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._is_over.set()
        self._thread.join()
        with suppress(InputError):  # without this, it is free in a minute
            if self.is_held():
                put_bytes(b"", self._path)

    def is_held(self) -> bool:
        """Whether no other process has taken the lock.

        Raises:
            StoreError: The store cannot be reached or refuses access.
        """
        return self._read().get("token") == self._token

    def require(self) -> None:
        """Check that no other process has taken the lock.

        Raises:
            InputError: One has, or the store cannot be reached or refuses access.
        """
        if not self.is_held():
            raise InputError(f"{self._folder}: {_describe(self._read())} has begun to write into it, so this one ends")

    def _refresh(self) -> None:
        while not self._is_over.wait(_REFRESH_S):
            with suppress(InputError):  # those who need the lock ask for it, and say what is wrong
                if not self.is_held():
                    return
                self._write()

    def _write(self) -> None:
        now = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime())
        content = {"host": socket.gethostname(), "pid": os.getpid(), "time": now, "token": self._token}
        put_bytes(json.dumps(content).encode(), self._path)

    def _read(self) -> dict[str, object]:
        """Content of the lock; empty if it is free, or is none of ours."""
        try:
            content = json.loads(self._path.read_bytes(_MAX_BYTES) or b"{}")
        except FileNotFoundError:
            return {}
        except ValueError:
            return {"pid": "unknown"}
        return content if isinstance(content, dict) else {"pid": "unknown"}


def require_writable_store(folder: ObjectPath) -> int:
    """Check that objects can be written into a folder and deleted, by an object that is deleted at once.

    An empty object that stands for the folder may stay.

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
    _delete(probe)
    return now_ns


def _delete(probe: ObjectPath) -> None:
    with suppress(FileNotFoundError), store_errors(str(probe)):
        connection().files.delete_file(probe.location)


def _describe(holder: dict[str, object]) -> str:
    return f"process {holder.get('pid')!s:.20} on {holder.get('host', 'an unknown host')!s:.100}"
