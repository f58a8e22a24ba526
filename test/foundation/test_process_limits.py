"""Limits in which a command or a graph cannot work are named, before they are reached and when they were."""

import errno
import os
import resource
import shutil
from collections import namedtuple
from collections.abc import Callable

import pytest

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.files.whole_files import write_errors
from simbev_ros.foundation.process_limits import (
    GRAPH_NEEDS,
    describe_shortage,
    ending_on_shortage,
    is_shortage,
    low_limits,
    message_with_limit,
    require_graph_limits,
)

SetLimit = Callable[[int, int], None]
NO_MORE = "no more processes or threads can be started by this user or in this container"


@pytest.fixture
def set_limit(monkeypatch: pytest.MonkeyPatch) -> SetLimit:
    """Pretend that a limit is in force, for a user for whom it holds; without, there is none."""
    values: dict[int, int] = {}
    monkeypatch.setattr(os, "geteuid", lambda: 1000)
    monkeypatch.setattr(resource, "getrlimit", lambda kind: (values.get(kind, resource.RLIM_INFINITY), -1))
    return values.__setitem__


@pytest.mark.parametrize(
    ("kind", "value", "line"),
    [
        (
            "AS",
            9 << 27,
            "ulimit -v allows 1.12 GiB of address space, and a graph needs 4 GiB; ulimit -v unlimited",
        ),
        ("AS", 0, "ulimit -v allows 0 GiB of address space, and a graph needs 4 GiB; ulimit -v unlimited"),
        ("NOFILE", 20, "ulimit -n allows 20 open files, and a graph needs 64; ulimit -n 1024"),
        ("NPROC", 40, "ulimit -u allows 40 processes and threads, and a graph needs 128; ulimit -u 1024"),
        ("FSIZE", 100 << 10, "ulimit -f allows 0.0977 MiB for a file, and a graph needs 256 MiB; ulimit -f unlimited"),
    ],
)
def test_a_limit_that_is_too_low_for_a_graph_is_refused(set_limit: SetLimit, kind: str, value: int, line: str) -> None:
    set_limit(getattr(resource, f"RLIMIT_{kind}"), value)
    with pytest.raises(InputError) as refused:
        require_graph_limits()
    assert str(refused.value) == f"{line} helps"


def test_limits_that_suffice_are_fine_and_low_ones_are_listed(set_limit: SetLimit) -> None:
    require_graph_limits()
    assert low_limits() == []
    for name, value in GRAPH_NEEDS.items():
        set_limit(getattr(resource, name), value)
    require_graph_limits()
    assert low_limits()[1] == "ulimit -n allows 64 open files"


def test_the_number_of_processes_is_not_limited_for_root(set_limit: SetLimit, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "geteuid", lambda: 0)
    set_limit(resource.RLIMIT_NPROC, 1)
    require_graph_limits()


@pytest.mark.parametrize(
    ("total", "writable", "problem"),
    [(1 << 20, True, "is full"), (1 << 20, False, "cannot be written to"), (0, True, None)],
)
@pytest.mark.usefixtures("set_limit")
def test_shared_memory_without_space_is_refused_where_there_is_a_limit(
    monkeypatch: pytest.MonkeyPatch, total: int, writable: bool, problem: str | None
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: writable)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: namedtuple("Usage", "total free")(total, 0))
    if problem is None:
        require_graph_limits()
        return
    with pytest.raises(InputError, match=rf"^/dev/shm: {problem}; processes of a graph share memory there"):
        require_graph_limits()


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "memory ran out: ulimit -v allows 2 GiB of address space; ulimit -v unlimited helps"),
        (ImportError("libx.so: failed to map segment from shared object"), "memory ran out: ulimit -v allows 2 GiB"),
        (RuntimeError("can't start new thread"), f"{NO_MORE}: ulimit -v allows 2 GiB of address space"),
        (BlockingIOError(errno.EAGAIN, "x"), NO_MORE),
        (RuntimeError("pthread_create failed: x"), NO_MORE),
        (
            OSError(errno.EMFILE, "x", "file"),
            "too many files are open: ulimit -n allows 2000 open files; ulimit -n 8000",
        ),
        (OSError(errno.ENFILE, "x"), "too many files are open on this machine"),
        (OSError(errno.EDQUOT, "x"), "the disk quota is used up"),
        (OSError(errno.ENOSPC, "x"), "the disk is full"),
        (OSError(errno.EFBIG, "x"), "the file is larger than files may be here: ulimit -f allows 3 MiB for a file"),
    ],
)
def test_an_error_of_any_class_says_what_ran_out(set_limit: SetLimit, error: Exception, words: str) -> None:
    set_limit(resource.RLIMIT_AS, 2 << 30)
    set_limit(resource.RLIMIT_NOFILE, 2000)
    set_limit(resource.RLIMIT_FSIZE, 3 << 20)
    assert (describe_shortage(error) or "").startswith(words)


@pytest.mark.parametrize(
    "error", [ValueError("a negative area"), OSError(errno.EROFS, "Read-only file system"), OSError(errno.EIO, "x")]
)
def test_other_errors_are_no_shortage(error: Exception) -> None:
    assert describe_shortage(error) is None and not is_shortage(error)


def test_the_limit_behind_an_error_for_users_is_added(set_limit: SetLimit) -> None:
    set_limit(resource.RLIMIT_NOFILE, 20)
    with pytest.raises(InputError) as refused, write_errors("out"):  # type: ignore[arg-type]
        raise OSError(errno.EMFILE, "Too many open files")
    message = message_with_limit(refused.value)
    assert message == (
        "out: cannot be written: Too many open files; ulimit -n allows 20 open files; ulimit -n 1024 helps"
    )
    assert message_with_limit(InputError("a: is wrong")) == "a: is wrong"


def test_a_program_ends_with_what_ran_out_as_its_last_line() -> None:
    with pytest.raises(SystemExit, match=r"^too many files are open on this machine$"), ending_on_shortage():
        raise OSError(errno.ENFILE, "x")
    with pytest.raises(ValueError, match=r"^a negative area$"), ending_on_shortage():
        raise ValueError("a negative area")
