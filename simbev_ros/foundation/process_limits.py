"""Limits of this process (``ulimit``): which a command needs, and which one an error of any library comes from.

Libraries in C crash, hang or print lines of their own where they reach a limit of address space, threads or files, so
commands check the limits before they load them. What runs out later arrives as an exception, and becomes one line.
"""

import errno
import os
import shutil
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from simbev_ros.foundation.errors import DISK_FULL, InputError, SimbevError

_MANY = 1024
"""Open files that are proposed at least, the usual limit of Linux; the same number serves for threads."""


_SHARED_MEMORY = "/dev/shm"
_MIN_SHARED_BYTES = 1 << 20
"""Space for the locks of processes, which end by SIGBUS without it. Messages go by UDP if they have no space."""


class _Limit(NamedTuple):
    """A limit: what it counts, the option of ``ulimit`` that sets it, and the unit of messages; 1: it is a number."""

    counts: str
    option: str
    unit: int = 1
    symbol: str = ""

    def allowed(self, value: int) -> str:
        """Clause on what is allowed."""
        return f"ulimit {self.option} allows {self.amount(value)} {self.counts}"

    def remedy(self, value: int) -> str:
        """Clause on the command that raises it."""
        return f"ulimit {self.option} {max(_MANY, 4 * value) if self.unit == 1 else 'unlimited'} helps"

    def amount(self, value: int) -> str:
        """The value in its unit."""
        return f"{value}" if self.unit == 1 else f"{value / self.unit:.3g}{self.symbol}"


_LIMITS = {
    "RLIMIT_AS": _Limit("of address space", "-v", 1 << 30, " GiB"),
    "RLIMIT_NOFILE": _Limit("open files", "-n"),
    "RLIMIT_NPROC": _Limit("processes and threads", "-u"),
    "RLIMIT_FSIZE": _Limit("for a file", "-f", 1 << 20, " MiB"),
}
"""Limits by their name in the module ``resource``, which Windows lacks."""

COMMAND_NEEDS = {"RLIMIT_AS": 1 << 30, "RLIMIT_NPROC": 32}
"""Limits below which a command that plays no scene does not start.

With 2 cores, ``info`` and ``verify`` work from 0.5 GB on and ``scene`` from 0.7 GB; with 0.6 GB SciPy's libraries end
``scene`` by SIGSEGV, and with 0.3 GB OpenBLAS waits for memory for ever. Larger maps and pages need more. ``scene``
starts 6 threads; OpenBLAS, which starts one for each core, interrupts the process if it cannot.
"""

GRAPH_NEEDS = {"RLIMIT_AS": 4 << 30, "RLIMIT_NOFILE": 64, "RLIMIT_NPROC": 128, "RLIMIT_FSIZE": 256 << 20}
"""Limits below which no graph starts.

With 2 cores, processes of ``config/cooperative.yaml`` reach 4.5 GiB of address space and do with less, but with 3 GB
drivers and libraries of small graphs end them. They hold up to 31 files; all have 152 threads, of a graph without
cameras and lidar 83. A segment of shared memory has 128 MiB (``config/fastdds.xml``).
"""

_SHORTAGES = {
    errno.ENOMEM: ("memory ran out", ("RLIMIT_AS",)),
    errno.EMFILE: ("too many files are open", ("RLIMIT_NOFILE",)),
    errno.ENFILE: ("too many files are open on this machine", ()),
    errno.EAGAIN: (
        "no more processes or threads can be started by this user or in this container",
        ("RLIMIT_NPROC", "RLIMIT_AS"),
    ),
    **{number: (words, ("RLIMIT_FSIZE",) if number == errno.EFBIG else ()) for number, words in DISK_FULL.items()},
}
"""Words, and the limits that may be the reason, for numbers of the operating system's errors."""

_TEXTS = {os.strerror(number): number for number in _SHORTAGES} | {
    "can't start new thread": errno.EAGAIN,
    "pthread_create failed": errno.EAGAIN,
    "failed to map segment": errno.ENOMEM,
    "bad_alloc": errno.ENOMEM,
    "Insufficient memory": errno.ENOMEM,
}
"""Texts by which errors of Python and libraries say the same."""


def describe_shortage(error: BaseException) -> str | None:
    """Describe in one clause what ran out, and the limit in force, if an error of any class comes from that."""
    number = _shortage(error)
    if number is None:
        return None
    words, limits = _SHORTAGES[number]
    return words + (f": {blame}" if (blame := _blame(limits)) else "")


@contextmanager
def ending_on_shortage() -> Iterator[None]:
    """Context of a program that others have started: what runs out ends the process, with its last line for them.

    Raises:
        SystemExit: Something ran out in the context; other errors stay as they are.
    """
    try:
        yield
    except Exception as error:
        if (problem := describe_shortage(error)) is None:
            raise
        sys.exit(problem)


def is_shortage(error: BaseException) -> bool:
    """Whether an error says that something ran out, so that neither content nor code is to blame."""
    return _shortage(error) is not None


def message_with_limit(error: SimbevError) -> str:
    """The message of an error, with the limit in force that made an operation fail for which it was raised."""
    cause: BaseException | None = error
    while isinstance(cause, SimbevError):
        cause = cause.__cause__ or cause.__context__
    number = _shortage(cause) if isinstance(cause, OSError) else None
    blame = None if number in (None, errno.EAGAIN) else _blame(_SHORTAGES[number][1])  # EAGAIN: of a lock
    return f"{error}; {blame}" if blame else str(error)


def limit_problems(subject: str, needs: Mapping[str, int]) -> Iterator[str]:
    """Sentences on the limits in force that are too low.

    Args:
        subject: What needs them.
        needs: Minimum by the limit's name in ``resource``.
    """
    for name, needed in needs.items():
        value = _in_force(name)
        if value is not None and value < needed:
            limit = _LIMITS[name]
            yield f"{limit.allowed(value)}, and {subject} needs {limit.amount(needed)}; {limit.remedy(value)}"


def require_limits(subject: str, needs: Mapping[str, int]) -> None:
    """Check limits before libraries are loaded that crash where they reach them.

    Raises:
        InputError: A limit is too low.
    """
    if problems := list(limit_problems(subject, needs)):
        raise InputError("\n".join(problems))


def require_graph_limits() -> None:
    """Check what a graph needs of the system before it starts.

    Raises:
        InputError: A limit is too low, /proc is missing, or /dev/shm is full or cannot be written to.
    """
    require_limits("a graph", GRAPH_NEEDS)
    if not Path("/proc/self").exists():
        raise InputError("/proc: is not mounted; a graph follows its processes there; mount -t proc proc /proc helps")
    if not os.access(_SHARED_MEMORY, os.W_OK):
        raise InputError(f"{_SHARED_MEMORY}: cannot be written to; processes of a graph share memory there")
    space = shutil.disk_usage(_SHARED_MEMORY)
    if space.total and space.free < _MIN_SHARED_BYTES:  # a tmpfs without a limit has a total of 0
        raise InputError(f"{_SHARED_MEMORY}: is full; processes of a graph share memory there, at best 1 GiB")


def low_limits() -> list[str]:
    """Clauses on the limits in force that a large graph may reach, for messages about processes that crashed."""
    values = {name: _in_force(name) for name in GRAPH_NEEDS}
    low = {name: value for name, value in values.items() if value is not None and value < 8 * GRAPH_NEEDS[name]}
    return [_LIMITS[name].allowed(value) for name, value in low.items()]


def _shortage(error: BaseException) -> int | None:
    """The number in ``_SHORTAGES`` of an error."""
    if isinstance(error, MemoryError):
        return errno.ENOMEM
    if isinstance(error, OSError) and error.errno is not None:
        return error.errno if error.errno in _SHORTAGES else None
    text = str(error)
    return next((number for words, number in _TEXTS.items() if words in text), None)


def _blame(names: Iterable[str]) -> str | None:
    """Clauses on the lowest of some limits in force, compared with what a graph needs."""
    values = {name: value for name in names if (value := _in_force(name)) is not None}
    if not values:
        return None
    name = min(values, key=lambda each: values[each] / GRAPH_NEEDS[each])
    return f"{_LIMITS[name].allowed(values[name])}; {_LIMITS[name].remedy(values[name])}"


def _in_force(name: str) -> int | None:
    """Value of a limit; None if there is none, or if it does not hold for this user."""
    try:
        import resource  # not on Windows
    except ImportError:
        return None
    if name == "RLIMIT_NPROC" and os.geteuid() == 0:
        return None
    value = resource.getrlimit(getattr(resource, name))[0]
    return None if value == resource.RLIM_INFINITY else value
