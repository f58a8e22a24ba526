"""Connection that writes into an object store, through obstore: conditional writes, and uploads that can be aborted.

Reading has a connection of its own (``connection``), because obstore hangs in a process whose parent has used it before
it forked, and loaders of training data fork.
"""

import errno
import os
import re
from collections.abc import Iterator
from configparser import ConfigParser, Error
from contextlib import contextmanager
from datetime import timedelta
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.object_store.connection import (
    KEY_VARIABLES,
    MAX_ATTEMPTS,
    StoreConflict,
    StoreError,
    refusal,
    store_endpoint,
    store_region,
    unreachable,
)

if TYPE_CHECKING:
    from obstore.store import S3Store

_CONNECT_TIMEOUT_S, _REQUEST_TIMEOUT_S, _RETRY_TIMEOUT_S = 0.8, 120.0, 180.0
"""A store may answer a copy, or the end of an upload in parts, only when all bytes are copied."""
_PAUSE, _MAX_PAUSE = timedelta(seconds=0.05), timedelta(seconds=1.6)
_METADATA_SERVICE = "169.254.169.254"
_ROLE_VARIABLES = (
    "AWS_WEB_IDENTITY_TOKEN_FILE",
    "AWS_CONTAINER_CREDENTIALS_RELATIVE_URI",
    "AWS_CONTAINER_CREDENTIALS_FULL_URI",
)
_CODE = re.compile(r"<Code>([^<]*)</Code>(?:\s*<Message>([^<]*)</Message>)?")
_STATUS = re.compile(r"status code: (\d+)")


def writer(bucket: str) -> "S3Store":
    """The connection of this process that writes into a bucket of the store that the environment names.

    Raises:
        InputError: The URL of the store is not valid, or the profile has no keys.
    """
    if _first_process() != os.getpid():
        raise RuntimeError("a process that was forked from one that writes into an object store cannot write into it")
    return _connect(bucket, store_endpoint(), store_region(), *_credentials())


@lru_cache
def _first_process() -> int:
    """Id of the process that was the first to write."""
    return os.getpid()


@lru_cache(maxsize=4)
def _connect(
    bucket: str, endpoint: str | None, region: str | None, keys: tuple[str, ...], profile_region: str | None
) -> "S3Store":
    """Connect; without keys, obstore asks for those of the machine's role."""
    from obstore.store import S3Store

    options: dict[str, Any] = {"region": region or profile_region or "us-east-1"}
    if endpoint is not None:
        options["endpoint"] = endpoint
    if keys:
        options |= zip(("access_key_id", "secret_access_key", "session_token"), keys, strict=False)
    elif endpoint is not None and not any(map(os.environ.get, _ROLE_VARIABLES)):
        options["skip_signature"] = True  # a store of one's own that needs no key
    return S3Store(
        bucket,
        **options,
        client_options={
            "allow_http": True,
            "connect_timeout": timedelta(seconds=_CONNECT_TIMEOUT_S),
            "timeout": timedelta(seconds=_REQUEST_TIMEOUT_S),
        },
        retry_config={
            "backoff": {"init_backoff": _PAUSE, "max_backoff": _MAX_PAUSE, "base": 2},
            "max_retries": MAX_ATTEMPTS - 1,
            "retry_timeout": timedelta(seconds=_RETRY_TIMEOUT_S),
        },
    )


def _credentials() -> tuple[tuple[str, ...], str | None]:
    """Keys of the environment or of a profile, empty if there are none, and the profile's region.

    Raises:
        InputError: A profile is named that has no keys, or its file cannot be read.
    """
    if all(map(os.environ.get, KEY_VARIABLES)):
        names = (*KEY_VARIABLES, "AWS_SESSION_TOKEN")
        return tuple(os.environ[name] for name in names if os.environ.get(name)), None
    chosen = os.environ.get("AWS_PROFILE")
    profile = _profile(chosen or "default")
    names = ("aws_access_key_id", "aws_secret_access_key", "aws_session_token")
    if chosen and not all(profile.get(name) for name in names[:2]):
        raise InputError(
            f"AWS_PROFILE: {chosen} has no keys in ~/.aws; for a role or SSO, put them into the environment by "
            "aws configure export-credentials --format env"
        )
    return tuple(profile[name] for name in names if profile.get(name)), profile.get("region")


def _profile(name: str) -> dict[str, str]:
    """Settings of a profile in the files of AWS tools; empty if there is none."""
    parser, folder = ConfigParser(interpolation=None), Path.home() / ".aws"
    sections = {"AWS_CONFIG_FILE": ("config", f"profile {name}"), "AWS_SHARED_CREDENTIALS_FILE": ("credentials", name)}
    found: dict[str, str] = {}
    for variable, (file, section) in sections.items():
        path = os.environ.get(variable) or folder / file
        try:
            parser.read(path, encoding="utf-8")
        except (Error, UnicodeDecodeError) as error:
            raise InputError(f"{path}: cannot be read: {' '.join(str(error).split())}") from None
        for each in {section, name}:
            found |= dict(parser[each]) if parser.has_section(each) else {}
    return found


@contextmanager
def writer_errors(url: str) -> Iterator[None]:
    """Turn errors of obstore within a block into errors for the user.

    Raises:
        FileNotFoundError: There is no such object.
        StoreConflict: The condition of a write does not hold.
        StoreError: The store cannot be reached, refuses access, or fails.
    """
    from obstore.exceptions import AlreadyExistsError, BaseError, PreconditionError

    try:
        yield
    except FileNotFoundError as error:
        if "NoSuchBucket" in str(error):
            raise StoreError(f"{url}: there is no such bucket") from None
        raise FileNotFoundError(errno.ENOENT, "no such object", url) from None
    except (AlreadyExistsError, PreconditionError):
        raise StoreConflict(f"{url}: another process has just written it") from None
    except BaseError as error:
        raise StoreError(f"{url}: {_reason(str(error).partition('Debug source:')[0])}") from None


def _reason(text: str) -> str:
    """One line for the user from an error of obstore, which quotes the store's answer."""
    code, message = found.groups() if (found := _CODE.search(text)) else ("", "")
    status = found[1] if (found := _STATUS.search(text)) else ""
    if _METADATA_SERVICE in text:
        return refusal("no credentials")
    if code == "NoSuchBucket":
        return "there is no such bucket"
    if status in ("401", "403"):
        return refusal(code or f"HTTP status {status}")
    if not status:
        return unreachable(" ".join(text.rpartition(" - ")[2].split()))
    return f"{code or 'failed'} (HTTP status {status}): {message or ' '.join(text.split())}"
