"""Connections that read object stores, made from the environment variables that AWS tools use, and their errors.

``pyarrow.fs`` is imported with the first connection, as programs that read local folders do not need it.
"""

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from simbev_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from pyarrow import NativeFile
    from pyarrow.fs import FileSystem

ENDPOINT_VARIABLES = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL")
"""Environment variables with the URL of the store, the first of them first; without them, it is that of AWS."""
REGION_VARIABLES = ("AWS_REGION", "AWS_DEFAULT_REGION")
KEY_VARIABLES = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")

_CREDENTIAL_VARIABLES = (
    *("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY", "AWS_SESSION_TOKEN", "AWS_PROFILE"),
    *("AWS_SHARED_CREDENTIALS_FILE", "AWS_CONFIG_FILE"),
)
MAX_ATTEMPTS = 7
"""Attempts of a request that the store refuses because it is busy, or that does not arrive. The pauses between them
double from 50 ms to 1.6 s. An unreachable store is given up after about 10 s, and one that refuses every fifth request
fails one in 80,000."""
_CONNECT_TIMEOUT_S = 0.8
_MAX_HANDLES = 4096
_ERROR = re.compile(r"AWS Error (\w+)(?: \(HTTP status (\d+)\))? during \w+ operation: (.*)", re.DOTALL)
_REFUSALS = {"ACCESS_DENIED", "INVALID_ACCESS_KEY_ID", "INVALID_CLIENT_TOKEN_ID", "SIGNATURE_DOES_NOT_MATCH"}
_CURL_CODE = re.compile(r"^curlCode: \d+, ")
_REQUEST_ID = re.compile(r" ?\(Request ID: [^)]*\)")


class StoreError(InputError):
    """An object store cannot be reached, refuses access or fails; the message names the URL. Exit code 2."""


class StoreConflict(StoreError):
    """A conditional write has found an object that another process has written."""


class Connection:
    """A connection to a store.

    Attributes:
        files: The store as a file system of pyarrow.
    """

    def __init__(self, files: "FileSystem") -> None:
        self.files = files
        self._handles: dict[str, NativeFile] = {}

    def open_object(self, location: str, *, again: bool = True) -> "NativeFile":
        """Open an object, given by bucket and key, for range reads from any thread; this costs one request.

        Args:
            location: Bucket and key.
            again: Whether to ask the store even if this process has opened the object before.
        """
        handle = None if again else self._handles.get(location)
        if handle is None:
            if len(self._handles) >= _MAX_HANDLES:
                self._handles.clear()
            handle = self._handles[location] = self.files.open_input_file(location)
        return handle


def connection() -> Connection:
    """The connection of this process to the store that the environment names.

    Raises:
        InputError: The URL of the store is not valid.
    """
    return _connect(os.getpid(), store_endpoint(), store_region(), tuple(map(os.environ.get, _CREDENTIAL_VARIABLES)))


def store_endpoint() -> str | None:
    """URL of the store that the environment names; None: AWS.

    Raises:
        InputError: It is not valid.
    """
    for name in ENDPOINT_VARIABLES:
        if endpoint := os.environ.get(name):
            if not _is_web_address(endpoint):
                raise InputError(f"{name}: is {endpoint!r}; allowed: a URL with http:// or https:// and a host")
            return endpoint
    return None


def _is_web_address(url: str) -> bool:
    try:
        parts = urlsplit(url)
        return parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0 and url.isprintable()
    except ValueError:  # as for a port of 99999
        return False


def store_region() -> str | None:
    """Region that the environment names."""
    return next((os.environ[name] for name in REGION_VARIABLES if os.environ.get(name)), None)


@lru_cache(maxsize=4)
def _connect(process: int, endpoint: str | None, region: str | None, credentials: tuple[str | None, ...]) -> Connection:
    """Connect one process; a forked one must not share its parent's sockets. The SDK looks up the credentials."""
    from pyarrow import fs

    options: dict[str, Any] = {"region": region} if region else {}
    if endpoint is not None:
        parts = urlsplit(endpoint)
        options |= {"region": region or "us-east-1", "scheme": parts.scheme}
        options["endpoint_override"] = parts.netloc + parts.path.rstrip("/")
    retries = fs.AwsDefaultS3RetryStrategy(max_attempts=MAX_ATTEMPTS)
    options |= {"connect_timeout": _CONNECT_TIMEOUT_S, "retry_strategy": retries}
    return Connection(fs.S3FileSystem(**options))


@contextmanager
def store_errors(url: str) -> Iterator[None]:
    """Turn errors of pyarrow within a block into errors for the user.

    Raises:
        FileNotFoundError: There is no such object.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    try:
        yield
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "no such object", url) from None
    except OSError as error:
        raise StoreError(f"{url}: {_reason(str(error))}") from None


def _reason(text: str) -> str:
    """One line for the user from an error of pyarrow, which quotes the error of the SDK."""
    found = _ERROR.search(text)
    if found is None:
        return " ".join(text.split())
    code, status, detail = found[1], found[2], " ".join(_REQUEST_ID.sub("", found[3]).split())
    if code == "NO_SUCH_BUCKET":
        return "there is no such bucket"
    if code == "NETWORK_CONNECTION":
        return unreachable(_CURL_CODE.sub("", detail.partition("; Details: ")[0]))
    if code in _REFUSALS or status == "403":
        return refusal(code)
    return f"{code}{f' (HTTP status {status})' if status else ''}: {detail}"


def unreachable(detail: str) -> str:
    """Words for the user: the store cannot be reached."""
    return f"{store_endpoint() or 'the store'} cannot be reached: {detail}"


def refusal(code: str) -> str:
    """Words for the user: the store refuses access."""
    has_key = all(os.environ.get(name) for name in KEY_VARIABLES)
    hint = "check the credentials and their rights" if has_key else f"{' and '.join(KEY_VARIABLES)} are not set"
    return f"access was refused ({code}); {hint}"
