"""Processes of a test, which are known by a variable in their environment."""

from pathlib import Path


def marked_processes(part: str, mark: bytes) -> list[int]:
    """Processes with a text in their command line and a variable, given as NAME=VALUE, in their environment."""
    found = []
    for path in Path("/proc").glob("[0-9]*"):
        try:
            words, variables = ((path / name).read_bytes() for name in ("cmdline", "environ"))
        except OSError:
            continue
        if part.encode() in words and mark in variables.split(b"\0"):
            found.append(int(path.name))
    return found
