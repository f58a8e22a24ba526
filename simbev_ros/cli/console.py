"""The look of the command line's output: progress bars, numbers with units, and consoles for tables."""

from collections.abc import Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.filesize import decimal
from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.text import Text

_PIPE_WIDTH = 160


class Bar:
    """One line of progress on a console."""

    def __init__(self, progress: Progress, task: TaskID) -> None:
        self._progress, self._task = progress, task

    def advance(self, count: int = 1) -> None:
        """Count further items."""
        self._progress.advance(self._task, count)

    def show(self, done: int, total: int | None = None) -> None:
        """Show how many items are done, and how many there are if that was unknown or has changed."""
        self._progress.update(self._task, completed=done, total=total)

    def describe(self, label: str) -> None:
        """Change the label."""
        self._progress.update(self._task, description=literal(label))


def table_console() -> Console:
    """A console for tables on standard output; in a pipe or file it is wide enough for them."""
    console = Console()
    return console if console.is_terminal else Console(width=_PIPE_WIDTH)


def counting_progress(console: Console, *more: ProgressColumn, transient: bool = True) -> Progress:
    """A progress display over the full width that counts finished items, with further columns at its end."""
    columns = (TextColumn("{task.description}"), BarColumn(bar_width=None), MofNCompleteColumn(), *more)
    return Progress(*columns, console=console, expand=True, transient=transient)


@contextmanager
def counting_bar(
    label: str, console: Console, total: int | None = None, *, elapsed: bool = False, remaining: bool = True
) -> Iterator[Bar]:
    """Show a bar that counts finished items while the context is open, and remove it at the end.

    Args:
        label: Name of the items, or of the work.
        console: Where to show the bar.
        total: Number of items; None: it is not known yet.
        elapsed: Whether to show the time since the start.
        remaining: Whether to show the estimated time to the end.
    """
    times = [*([TimeElapsedColumn()] if elapsed else []), *([TimeRemainingColumn()] if remaining else [])]
    with counting_progress(console, *times) as progress:
        yield Bar(progress, progress.add_task(literal(label), total=total))


@contextmanager
def percent_bar(label: str, console: Console, total: int | None = None, *, hidden: bool = False) -> Iterator[Bar]:
    """Show a short bar with a percentage while the context is open, and remove it at the end."""
    with Progress(console=console, transient=True, disable=hidden) as progress:
        yield Bar(progress, progress.add_task(literal(label), total=total))


class TickRate(ProgressColumn):
    """Recent ticks per second."""

    def render(self, task: Task) -> Text:
        """The text of the column."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f} ticks/s", style="progress.data.speed")


def literal(text: object) -> str:
    """Text from data or a path, to print among markup: as it is, with control characters as escape sequences."""
    return escape(printable(str(text)))


def printable(text: str) -> str:
    """Text with control characters as escape sequences, so that it cannot control the terminal."""
    return "".join(char if char.isprintable() or char == "\n" else ascii(char)[1:-1] for char in text)


def plural(count: int, noun: str) -> str:
    """A number with its noun, such as ``1 scene`` or ``3 scenes``."""
    return f"{count} {noun}{'s' * (count != 1)}"


def format_size(size_bytes: float) -> str:
    """A size in decimal units, such as ``1.5 GB``."""
    return decimal(round(size_bytes))


def format_duration(duration_s: float) -> str:
    """A rounded duration in s, min or h."""
    minutes = round(duration_s / 60.0)
    return f"{duration_s:.0f} s" if minutes < 2 else f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
