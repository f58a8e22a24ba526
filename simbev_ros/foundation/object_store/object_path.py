"""Paths of objects in an object store, with the part of pathlib's interface that reading needs.

Code that reads local files and objects alike takes an ``AnyPath``; ``path_or_url`` makes one from what a user typed.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import BinaryIO, Literal, cast

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.connection import SCHEME, ObjectStat, StoreError, connection, url_of
from simbev_ros.foundation.object_store.object_reader import ObjectReader

_URL = re.compile(r"([A-Za-z][A-Za-z0-9+.-]*)://(.*)", re.DOTALL)
_BUCKET = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{1,62}")


@dataclass(frozen=True, order=True, slots=True)
class ObjectPath:
    """An object, or a folder of objects, ``s3://bucket/key``.

    A folder is a common prefix of keys; it exists as long as it has objects. All methods that ask the store raise
    ``StoreError`` if it cannot be reached or refuses access.

    Attributes:
        bucket: Name of the bucket.
        key: The object's key, or the folder's without a slash at its end; empty for the bucket itself.
    """

    bucket: str
    key: str = ""

    @property
    def name(self) -> str:
        """Last part of the key; for the bucket itself, its name."""
        return self.key.rpartition("/")[2] or self.bucket

    @property
    def stem(self) -> str:
        """The name without its suffix."""
        return PurePosixPath(self.name).stem

    @property
    def suffix(self) -> str:
        """The last dot of the name and what follows it."""
        return PurePosixPath(self.name).suffix

    @property
    def parent(self) -> "ObjectPath":
        """The folder that contains this; the bucket is its own parent."""
        return ObjectPath(self.bucket, self.key.rpartition("/")[0])

    def with_name(self, name: str) -> "ObjectPath":
        """The path with another name."""
        return self.parent / name

    def with_suffix(self, suffix: str) -> "ObjectPath":
        """The path with another suffix, or without one."""
        return self.with_name(self.stem + suffix)

    def relative_to(self, folder: "ObjectPath") -> PurePosixPath:
        """The path from a folder to this. Raises ValueError if it is not in the folder."""
        if self.bucket != folder.bucket:
            raise ValueError(f"{self} is not in {folder}")
        return PurePosixPath(self.key).relative_to(folder.key)

    def __truediv__(self, name: str | PurePosixPath) -> "ObjectPath":
        return ObjectPath(self.bucket, "/".join(part for part in (self.key, *str(name).split("/")) if part))

    def __str__(self) -> str:
        return url_of(self.bucket, self.key)

    def exists(self) -> bool:
        """Whether there is an object or a folder."""
        return self.is_file() or self.is_dir()

    def is_file(self) -> bool:
        """Whether there is an object."""
        try:
            return bool(self.key) and self.stat() is not None
        except FileNotFoundError:
            return False

    def is_dir(self) -> bool:
        """Whether there is a folder."""
        asked = connection()
        return asked.is_folder(self.bucket, self.key) if self.key else asked.is_bucket(self.bucket)

    def stat(self) -> ObjectStat:
        """Facts about an object. Raises FileNotFoundError if there is none."""
        return connection().stat(self.bucket, self.key)

    def iterdir(self) -> Iterator["ObjectPath"]:
        """Yield the entries of a folder, sorted by name; none if there is no folder."""
        found = connection().entries(self.bucket, self.key, is_recursive=False)
        names = {key.removeprefix(f"{self.key}/" if self.key else "").removesuffix("/") for key, _ in found}
        return iter(sorted(self / name for name in names if name))

    def glob(self, pattern: str) -> Iterator["ObjectPath"]:
        """Yield the entries of a folder whose names match a pattern, which has one level, sorted by name."""
        if "/" in pattern:
            raise ValueError(f"{pattern}: has more than one level")
        return (path for path in self.iterdir() if fnmatchcase(path.name, pattern))

    def open(self, mode: Literal["rb"] = "rb", *, again: bool = True) -> BinaryIO:
        """Open an object for range reads; see ``ObjectReader``.

        Args:
            mode: Reading only.
            again: Whether to ask the store even if this process has opened the object before.

        Raises:
            FileNotFoundError: There is no such object.
        """
        return cast(BinaryIO, ObjectReader(self.bucket, self.key, again=again))

    def read_bytes(self, max_bytes: int | None = None) -> bytes:
        """The content of an object.

        Raises:
            FileNotFoundError: There is no such object.
            InputError: It is larger than ``max_bytes``.
        """
        with self.open() as stream:
            size = stream.seek(0, 2)
            if max_bytes is not None and size > max_bytes:
                raise InputError(f"{self}: is larger than {max_bytes >> 20} MiB")
            stream.seek(0)
            return stream.read(size)


AnyPath = Path | ObjectPath
"""A local path, or one in an object store."""


def path_or_url(text: str | AnyPath) -> AnyPath:
    """The path that a user means: an object's for a URL with ``s3://``, otherwise a local one.

    Raises:
        InputError: The URL has another scheme, or no valid name of a bucket.
    """
    if not isinstance(text, str):
        return text
    if (match := _URL.match(text)) is None:
        return Path(text)
    scheme, rest = match.groups()
    if scheme.lower() != SCHEME:
        raise InputError(f"{text}: URLs with {scheme}:// are not supported; allowed: {SCHEME}://bucket/prefix")
    bucket, _, key = rest.partition("/")
    if not _BUCKET.fullmatch(bucket):
        raise InputError(f"{text}: {bucket!r} is not a valid bucket name; allowed: {SCHEME}://bucket/prefix")
    return ObjectPath(bucket) / key


def require_bucket(path: ObjectPath) -> None:
    """Check that the bucket of a path exists, to explain why nothing was found.

    Raises:
        StoreError: There is no such bucket.
    """
    if not ObjectPath(path.bucket).exists():
        raise StoreError(f"{path}: there is no bucket {path.bucket!r}")


def require_local(path: AnyPath) -> Path:
    """The path, which must be local.

    Raises:
        InputError: It is in an object store.
    """
    if isinstance(path, ObjectPath):
        raise InputError(f"{path}: only local folders are allowed here")
    return path
