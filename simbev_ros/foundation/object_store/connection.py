"""Connections that read object stores, made from the environment variables that AWS tools use, and their errors."""

import errno
import os
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple
from urllib.parse import urlsplit

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.limits import MAX_EMPTY_PAGES, MAX_LISTED_OBJECTS
from simbev_ros.foundation.object_store.store_client import (
    CREDENTIAL_VARIABLES,
    KEY_VARIABLES,
    AnswerError,
    is_of_network,
    make_client,
)
from simbev_ros.foundation.units import NS_PER_S

ENDPOINT_VARIABLES = ("AWS_ENDPOINT_URL_S3", "AWS_ENDPOINT_URL")
"""Environment variables with the URL of the store, the first of them first; without them, it is that of AWS."""
REGION_VARIABLES = ("AWS_REGION", "AWS_DEFAULT_REGION")
SCHEME = "s3"
_MAX_KNOWN_SIZES = 4096
_MAX_WORDS = 200


class StoreError(InputError):
    """An object store cannot be reached, refuses access or fails; the message names the URL. Exit code 2."""


class StoreConflict(StoreError):
    """A conditional write has found an object that another process has written."""


class ObjectStat(NamedTuple):
    """Facts about an object, named as in ``os.stat_result``; the time is that of the store's clock."""

    st_size: int
    st_mtime_ns: int


class Connection:
    """A connection to a store, for any thread.

    Every method raises StoreError if the store cannot be reached, refuses access or fails.

    Args:
        client: botocore's client of S3.
    """

    def __init__(self, client: Any) -> None:
        self._client = client
        self._sizes: dict[tuple[str, str], int] = {}

    def stat(self, bucket: str, key: str) -> ObjectStat:
        """Facts about an object; this costs one request. Raises FileNotFoundError if there is none."""
        answer = self._send("head_object", bucket, key, Key=key)
        try:
            return ObjectStat(answer["ContentLength"], int(answer["LastModified"].timestamp()) * NS_PER_S)
        except KeyError:
            raise StoreError(f"{url_of(bucket, key)}: the store does not say its size and time") from None

    def size(self, bucket: str, key: str, *, again: bool = True) -> int:
        """Size of an object in bytes. Raises FileNotFoundError if there is none.

        Args:
            bucket: Name of the bucket.
            key: The object's key.
            again: Whether to ask the store even if this process has asked before.
        """
        known = None if again else self._sizes.get((bucket, key))
        if known is None:
            if len(self._sizes) >= _MAX_KNOWN_SIZES:
                self._sizes.clear()
            known = self._sizes[bucket, key] = self.stat(bucket, key).st_size
        return known

    def read(self, bucket: str, key: str, start: int, end: int) -> bytes:
        """Bytes of an object. Raises FileNotFoundError if there is none."""
        answer = self._send("get_object", bucket, key, Key=key, Range=f"bytes={start}-{end - 1}")
        body: bytes = answer["Body"].read()
        if len(body) != end - start or (answer["ResponseMetadata"]["HTTPStatusCode"] != 206 and start):
            raise StoreError(f"{url_of(bucket, key)}: the store does not send bytes {start:,} to {end:,} of it")
        return body

    def read_whole(self, bucket: str, key: str) -> tuple[bytes, str]:
        """Content and entity tag of a small object. Raises FileNotFoundError if there is none."""
        answer = self._send("get_object", bucket, key, Key=key)
        return answer["Body"].read(), answer.get("ETag", "")

    def is_bucket(self, bucket: str) -> bool:
        """Whether there is a bucket."""
        try:
            self._send("head_bucket", bucket)
        except FileNotFoundError:
            return False
        return True

    def is_folder(self, bucket: str, key: str) -> bool:
        """Whether there are objects in a folder."""
        return any(self.entries(bucket, key, is_recursive=True, max_keys=1))

    def entries(
        self, bucket: str, key: str, *, is_recursive: bool, max_keys: int = 1000
    ) -> Iterator[tuple[str, int | None]]:
        """Yield the key and size of all that is in a folder; nothing if there is no folder or no bucket.

        Args:
            bucket: Name of the bucket.
            key: The folder's key.
            is_recursive: Whether to list the folders in it as well; otherwise each of them is an entry, with a slash
                at its end and None as its size.
            max_keys: Maximum number of entries in an answer.

        Raises:
            StoreError: The list repeats itself, or is longer than that of any dataset.
        """
        query: dict[str, Any] = {"Prefix": f"{key}/" if key else "", "MaxKeys": max_keys}
        query |= {} if is_recursive else {"Delimiter": "/"}
        count = empty_pages = 0
        while True:
            try:
                page = self._send("list_objects_v2", bucket, key, **query)
                found = {each["Key"]: each["Size"] for each in page.get("Contents", ())}
                found |= {each["Prefix"]: None for each in page.get("CommonPrefixes", ())}
                token = page["NextContinuationToken"] if page["IsTruncated"] else None
            except FileNotFoundError:
                return
            except KeyError as error:
                raise StoreError(f"{url_of(bucket, key)}: the store's list is without {error}") from None
            count, empty_pages = count + len(found), empty_pages + (not found)
            if token and token == query.get("ContinuationToken"):
                raise StoreError(f"{url_of(bucket, key)}: the store's list repeats itself")
            if count > MAX_LISTED_OBJECTS or empty_pages > MAX_EMPTY_PAGES:
                what = f"{MAX_LISTED_OBJECTS:,} objects, or {MAX_EMPTY_PAGES:,} pages without one"
                raise StoreError(f"{url_of(bucket, key)}: the store lists more than {what}")
            yield from found.items()
            if not token:
                return
            query["ContinuationToken"] = token

    def _send(self, operation: str, bucket: str, key: str = "", **parameters: object) -> Any:
        """A good answer of the store."""
        from botocore.exceptions import BotoCoreError, ClientError
        from urllib3.exceptions import HTTPError

        url = url_of(bucket, key)
        try:
            return getattr(self._client, operation)(Bucket=bucket, **parameters)
        except ClientError as error:
            reason = _refused(url, error.response)
        except (AnswerError, BotoCoreError, HTTPError) as error:
            reason = unreachable(_one_line(error)) if is_of_network(error) else _one_line(error)
        except (ValueError, LookupError, TypeError, ArithmeticError) as error:  # of botocore's parser
            reason = f"the store's answer cannot be read: {_one_line(error)}"
        raise StoreError(f"{url}: {reason}") from None


def _one_line(error: Exception) -> str:
    """An error's words, without botocore's frame around others' and the address that it quotes at their end."""
    words = str(error).removeprefix("An HTTP Client raised an unhandled exception: ").partition(': "http')[0]
    return " ".join(words.split())[:_MAX_WORDS]


def _refused(url: str, answer: dict[str, Any]) -> str:
    """Words for the user from an answer that is an error. Raises FileNotFoundError if nothing is there."""
    facts, error = answer["ResponseMetadata"], answer.get("Error", {})
    status, place = facts["HTTPStatusCode"], facts["HTTPHeaders"].get("location")
    code = f"{error.get('Code') or 'failed':.40}"
    if status == 404:
        raise FileNotFoundError(errno.ENOENT, "no such object", url)
    if status in (401, 403):
        return refusal(f"HTTP status {status}" if code.isdecimal() else code)
    if 300 <= status < 400 and place:
        return redirection(repr(place)[:_MAX_WORDS])
    words = " ".join(str(error.get("Message", "")).split())
    return f"{code} (HTTP status {status})" + (f": {words:.{_MAX_WORDS}}" if words else "")


def redirection(place: str) -> str:
    """Words for the user: the store redirects a request."""
    store = store_endpoint() or "the store"
    return f"{store} redirects to {place}, which gets no request; if the data are there, name it as the endpoint"


def url_of(bucket: str, key: str) -> str:
    """URL of an object or a folder."""
    return f"{SCHEME}://{bucket}/{key}" if key else f"{SCHEME}://{bucket}"


def connection() -> Connection:
    """The connection of this process to the store that the environment names.

    Raises:
        InputError: The URL of the store is not valid.
    """
    return _connect(os.getpid(), store_endpoint(), store_region(), tuple(map(os.environ.get, CREDENTIAL_VARIABLES)))


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
    """Connect one process, with these credentials; a forked one must not share its parent's sockets."""
    return Connection(make_client(endpoint, region))


def unreachable(detail: str) -> str:
    """Words for the user: the store cannot be reached."""
    return f"{store_endpoint() or 'the store'} cannot be reached: {detail}"


def refusal(code: str) -> str:
    """Words for the user: the store refuses access."""
    has_key = all(os.environ.get(name) for name in KEY_VARIABLES)
    hint = "check the credentials and their rights" if has_key else f"{' and '.join(KEY_VARIABLES)} are not set"
    return f"access was refused ({code}); {hint}"
