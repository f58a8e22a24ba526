"""Connection that writes into an object store, through obstore: conditional writes, and uploads that can be aborted.

Reading has a connection of its own (``connection``), because obstore hangs in a process whose parent has used it before
it forked, and loaders of training data fork.
"""

import errno
import os
import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from simbev_ros.foundation.object_store.connection import (
    StoreConflict,
    StoreError,
    redirection,
    refusal,
    store_endpoint,
    store_region,
    unreachable,
)
from simbev_ros.foundation.object_store.store_client import MAX_ATTEMPTS, aws_session, signing_region

if TYPE_CHECKING:
    from botocore.credentials import Credentials
    from obstore.store import ClientConfig, S3Credential, S3Store

_CONNECT_TIMEOUT_S, _REQUEST_TIMEOUT_S, _RETRY_TIMEOUT_S = 0.8, 120.0, 180.0
"""A store may answer a copy, or the end of an upload in parts, only when all bytes are copied."""
_PAUSE, _MAX_PAUSE = timedelta(seconds=0.05), timedelta(seconds=1.6)
_CREDENTIALS_LIFETIME = timedelta(minutes=10)
"""Time after which obstore asks for the credentials again, which botocore renews 15 minutes before they expire."""
_NOWHERE = "127.0.0.1:1"
_CODE = re.compile(r"<Code>([^<]*)</Code>(?:\s*<Message>([^<]*)</Message>)?")
_STATUS = re.compile(r"status code: (\d+)")


def writer(bucket: str) -> "S3Store":
    """The connection of this process that writes into a bucket of the store that the environment names.

    Raises:
        InputError: The URL of the store or the credentials are not valid.
    """
    if _first_process() != os.getpid():
        raise RuntimeError("a process that was forked from one that writes into an object store cannot write into it")
    return _connect(bucket, store_endpoint(), signing_region(store_region()), aws_session().get_credentials())


@lru_cache
def _first_process() -> int:
    """Id of the process that was the first to write."""
    return os.getpid()


@lru_cache(maxsize=4)
def _connect(bucket: str, endpoint: str | None, region: str, credentials: "Credentials | None") -> "S3Store":
    """Connect; without credentials, requests are unsigned."""
    from botocore.utils import get_environ_proxies
    from obstore.store import S3Store

    client: ClientConfig = {
        "allow_http": True,
        "connect_timeout": timedelta(seconds=_CONNECT_TIMEOUT_S),
        "timeout": timedelta(seconds=_REQUEST_TIMEOUT_S),
    }
    options: dict[str, Any] = {"region": region}
    if endpoint is not None:
        options["endpoint"] = endpoint
        if not get_environ_proxies(endpoint):
            # obstore follows redirects; those to other hosts lead to a proxy that does not exist.
            client |= {"proxy_url": f"http://{_NOWHERE}", "proxy_excludes": urlsplit(endpoint).hostname or ""}
    if credentials is None:
        options["skip_signature"] = True
    else:
        options["credential_provider"] = partial(_current_keys, credentials)
    return S3Store(
        bucket,
        **options,
        client_options=client,
        retry_config={
            "backoff": {"init_backoff": _PAUSE, "max_backoff": _MAX_PAUSE, "base": 2},
            "max_retries": MAX_ATTEMPTS - 1,
            "retry_timeout": timedelta(seconds=_RETRY_TIMEOUT_S),
        },
    )


def _current_keys(credentials: "Credentials") -> "S3Credential":
    """What obstore takes of the credentials that botocore has found and renews."""
    access_key, secret_key, token, *_ = credentials.get_frozen_credentials()
    end = datetime.now(UTC) + _CREDENTIALS_LIFETIME
    return {"access_key_id": access_key, "secret_access_key": secret_key, "token": token, "expires_at": end}


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
        raise StoreError(f"{url}: {_reason(*str(error).partition('Debug source:')[::2])}") from None


def _reason(text: str, source: str) -> str:
    """One line for the user from an error of obstore, which quotes the store's answer, and from its source."""
    code, message = found.groups() if (found := _CODE.search(text)) else ("", "")
    status = found[1] if (found := _STATUS.search(text)) else ""
    if code == "NoSuchBucket":
        return "there is no such bucket"
    if status in ("401", "403"):
        return refusal(code or f"HTTP status {status}")
    is_foreign = f" {_NOWHERE}," in source and store_endpoint() != f"http://{_NOWHERE}"
    if is_foreign or (status.startswith("3") and not code):
        return redirection("another address")
    if not status:
        return unreachable(" ".join(text.rpartition(" - ")[2].split()))
    return f"{code or 'failed'} (HTTP status {status}): {message or ' '.join(text.split())}"
