"""Client that reads object stores through botocore, with the bounds that botocore lacks.

botocore looks up the credentials, signs, and follows no redirect to another host. Each answer is read at once, up to
the size that was asked for, at a minimum rate, and asked for again when the store is busy. botocore is imported with
the first client, as programs that read local folders do not need it.
"""

import io
import os
import time
from collections.abc import Iterator
from functools import lru_cache
from http.client import HTTPResponse
from socket import SO_KEEPALIVE, SOL_SOCKET, socket
from typing import TYPE_CHECKING, Any

from simbev_ros.foundation.errors import InputError

if TYPE_CHECKING:
    from botocore.awsrequest import AWSPreparedRequest, AWSResponse
    from botocore.session import Session

KEY_VARIABLES = ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY")
CREDENTIAL_VARIABLES = (
    *(*KEY_VARIABLES, "AWS_SESSION_TOKEN", "AWS_PROFILE"),
    *("AWS_SHARED_CREDENTIALS_FILE", "AWS_CONFIG_FILE", "HOME"),
    *("AWS_CONTAINER_CREDENTIALS_RELATIVE_URI", "AWS_CONTAINER_CREDENTIALS_FULL_URI", "AWS_WEB_IDENTITY_TOKEN_FILE"),
)
"""Environment variables on which the credentials depend; a change of one makes a new session."""
MAX_ATTEMPTS = 7
"""Attempts of a request that the store refuses because it is busy, or that does not arrive. The pauses between them
double from 50 ms to 1.6 s. An unreachable store is given up after about 10 s, and one that refuses every fifth request
fails one in 80,000."""
MIN_BYTES_PER_S, RATE_WINDOW_S = 1 << 10, 60.0
"""Minimum rate of an answer, and the time over which it is measured; a modem has 5 KiB/s."""
MAX_ANSWER_BYTES = 16 << 20
"""Size of the longest answer that is not a range of an object: a list of 1000 keys of 1 KiB, each byte quoted by three
characters, and their properties."""
_CONNECT_TIMEOUT_S, _SILENCE_TIMEOUT_S = 0.8, 10.0
_MAX_IDLE = 256
_BUSY = {408, 429, 500, 502, 503, 504}
_DEFAULT_REGION = "us-east-1"


class AnswerError(Exception):
    """An answer is too slow or too long to be read; the message says which."""


def aws_session() -> "Session":
    """The session of this process with the credentials that AWS tools use.

    Raises:
        InputError: The environment or a file of AWS tools is not valid.
    """
    return _session(os.getpid(), tuple(map(os.environ.get, CREDENTIAL_VARIABLES)))


@lru_cache(maxsize=4)
def _session(process: int, environment: tuple[str | None, ...]) -> "Session":
    from botocore.exceptions import BotoCoreError
    from botocore.session import Session

    session = Session()
    try:
        if session.get_credentials() is None and (profile := os.environ.get("AWS_PROFILE")):
            raise InputError(f"AWS_PROFILE: {profile} has no credentials in ~/.aws; aws configure list shows why")
    except BotoCoreError as error:
        raise InputError(f"credentials for the object store: {' '.join(str(error).split())}") from None
    return session


def signing_region(region: str | None) -> str:
    """The region for signatures: this one, else that of the profile, else the default."""
    return region or aws_session().get_config_variable("region") or _DEFAULT_REGION


def make_client(endpoint: str | None, region: str | None) -> Any:
    """Make botocore's client of S3, for any thread of this process; without credentials, its requests are unsigned.

    Args:
        endpoint: URL of the store; None: AWS.
        region: Its region, if it is known.

    Raises:
        InputError: The credentials are not valid.
    """
    from botocore import UNSIGNED
    from botocore.config import Config
    from botocore.httpsession import URLLib3Session
    from botocore.utils import get_environ_proxies

    session = aws_session()
    config = Config(
        signature_version=None if session.get_credentials() else UNSIGNED,
        s3={"addressing_style": "path" if endpoint else "auto"},
        retries={"mode": "standard", "total_max_attempts": 1},  # _pause_s decides
        request_checksum_calculation="when_required",
        response_checksum_validation="when_required",
        ignore_configured_endpoint_urls=True,
    )
    client = session.create_client("s3", signing_region(region), endpoint_url=endpoint, config=config)
    http = URLLib3Session(
        verify=session.get_config_variable("ca_bundle") or os.environ.get("REQUESTS_CA_BUNDLE") or True,
        proxies=get_environ_proxies(client.meta.endpoint_url),
        timeout=(_CONNECT_TIMEOUT_S, _SILENCE_TIMEOUT_S),
        max_pool_connections=_MAX_IDLE,
        socket_options=[(SOL_SOCKET, SO_KEEPALIVE, 1)],
    )
    http._pool_classes_by_scheme.update(_paced_pools())
    client.meta.events.register("before-send.s3", _Sender(http))
    client.meta.events.register_first("needs-retry.s3", _pause_s)
    return client


class _Sender:
    """Sends a request in botocore's place, and reads the answer within its bounds."""

    def __init__(self, http: Any) -> None:
        self._http = http

    def __call__(self, request: "AWSPreparedRequest", **_: object) -> "AWSResponse":
        from botocore.awsrequest import AWSResponse
        from botocore.exceptions import IncompleteReadError

        request.stream_output = True  # the body is left to the lines below
        answer = self._http.send(request)
        limit = _requested_bytes(request) if answer.status_code < 300 else MAX_ANSWER_BYTES
        try:
            body = answer.raw.read(limit + 1)
            if len(body) > limit:
                raise AnswerError(f"the store sends more than the {limit:,} bytes that were asked for")
            expected = answer.headers.get("content-length", "")
            if request.method != "HEAD" and expected.isdecimal() and len(body) < int(expected):
                raise IncompleteReadError(actual_bytes=len(body), expected_bytes=int(expected))
        except BaseException:
            answer.raw.close()
            raise
        return AWSResponse(request.url, answer.status_code, answer.headers, _Body(body))


class _Body(io.BytesIO):
    """A body that has been read, with the method by which botocore reads one."""

    def stream(self) -> Iterator[bytes]:
        yield self.getvalue()


def _requested_bytes(request: "AWSPreparedRequest") -> int:
    """Size of the longest body that a good answer may have."""
    span = request.headers.get("Range")
    if span is None:
        return MAX_ANSWER_BYTES
    first, _, last = (span.decode() if isinstance(span, bytes) else span).removeprefix("bytes=").partition("-")
    return int(last) - int(first) + 1


def is_of_network(error: Exception | None) -> bool:
    """Whether an error of a request is one of the network, after which it is worth another attempt."""
    from botocore.exceptions import ConnectionError, HTTPClientError, IncompleteReadError
    from urllib3.exceptions import HTTPError

    # HTTPClientError itself, but none of its kinds, is around errors that botocore does not know.
    is_known = isinstance(error, (ConnectionError, HTTPClientError, IncompleteReadError, HTTPError))
    return is_known and type(error) is not HTTPClientError


def _pause_s(attempts: int, response: Any, caught_exception: Exception | None, operation: Any, **_: object) -> Any:
    """Time before the next attempt; None: there is none, or botocore decides, which knows regions."""
    from botocore.exceptions import ClientError

    if response is None:
        is_busy = is_of_network(caught_exception)
    else:
        answer, content = response
        if 300 <= answer.status_code < 400 and "x-amz-bucket-region" not in answer.headers:
            raise ClientError(content, operation.name)  # botocore would ask for the region until its stack overflows
        is_busy = answer.status_code in _BUSY
    return 0.05 * 2 ** (attempts - 1) if is_busy and attempts < MAX_ATTEMPTS else None


def _paced_pools() -> dict[str, type]:
    """Pools of botocore's connections, by scheme, that follow no redirect, and whose answers keep the minimum rate."""
    from botocore import awsrequest

    pools = {
        "http": (awsrequest.AWSHTTPConnectionPool, awsrequest.AWSHTTPConnection),
        "https": (awsrequest.AWSHTTPSConnectionPool, awsrequest.AWSHTTPSConnection),
    }
    return {
        scheme: type(
            "PacedPool",
            (_WithoutRedirects, pool),
            {"ConnectionCls": type("PacedConnection", (connection,), {"response_class": _PacedResponse})},
        )
        for scheme, (pool, connection) in pools.items()
    }


class _WithoutRedirects:
    """A pool that leaves redirects to its user; botocore only lets urllib3 give them up."""

    def urlopen(self, *arguments: Any, **options: Any) -> Any:
        return super().urlopen(*arguments, **options, redirect=False)  # type: ignore[misc]


class _PacedResponse(HTTPResponse):
    """A response, of which headers and body must arrive at the minimum rate."""

    def __init__(self, channel: socket, *arguments: Any, **options: Any) -> None:
        super().__init__(channel, *arguments, **options)
        self.fp = io.BufferedReader(_PacedStream(self.fp.detach()), 1 << 16)


class _PacedStream(io.RawIOBase):
    def __init__(self, stream: io.RawIOBase) -> None:
        self._stream, self._start_s, self._bytes = stream, time.monotonic(), 0

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any, /) -> int | None:
        count = self._stream.readinto(buffer)
        self._bytes += count or 0
        passed_s = time.monotonic() - self._start_s
        if passed_s > RATE_WINDOW_S:
            if self._bytes < MIN_BYTES_PER_S * passed_s:
                raise AnswerError(f"the store sends less than {MIN_BYTES_PER_S:,} bytes a second")
            self._start_s, self._bytes = time.monotonic(), 0
        return count

    def close(self) -> None:
        self._stream.close()
        super().close()
