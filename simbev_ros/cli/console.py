"""The look of the command line's output: progress bars, numbers with units, and consoles for tables."""

import os
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import Any

from rich.console import Console, ConsoleOptions, RenderableType
from rich.filesize import decimal
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskID,
    TaskProgressColumn,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)
from rich.segment import Segment
from rich.status import Status
from rich.text import Text

_PIPE_WIDTH = 160
_REPORT_PERIOD_S = 30.0
_SPACE = "\n\t\N{NO-BREAK SPACE}"
DESCRIPTION = TextColumn("{task.description}", markup=False)
"""The label of a line of progress."""


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
        self._progress.update(self._task, description=label)


class _Reporter:
    """Prints lines from time to time where no bar is drawn: into a pipe, a file, or the log of a job.

    Args:
        console: Where to print; nothing is printed on a terminal.
        lines: Gives the lines.
    """

    def __init__(self, console: Console, lines: Callable[[], Iterable[str]]) -> None:
        self._console, self._lines = console, lines
        self._ended = Event()

    def start(self) -> None:
        """Print from now on."""
        if not self._console.is_terminal:
            self._ended.clear()
            Thread(target=self._report, daemon=True).start()

    def stop(self) -> None:
        """Print no more."""
        self._ended.set()

    def _report(self) -> None:
        while not self._ended.wait(_REPORT_PERIOD_S):
            for line in self._lines():
                self._console.print(line, highlight=False, soft_wrap=True)


class ReportingProgress(Progress):
    """Bars on a terminal; elsewhere a line for each of them every 30 seconds. Arguments are those of ``Progress``."""

    def __init__(self, *columns: ProgressColumn, **options: Any) -> None:
        super().__init__(*columns, **options)
        self._reporter = _Reporter(self.console, lambda: map(_line_of, self.tasks))

    def start(self) -> None:
        """Show the bars, or begin to print."""
        super().start()
        if not self.disable:
            self._reporter.start()

    def stop(self) -> None:
        """Leave or remove the bars, and print no more."""
        self._reporter.stop()
        super().stop()


def _line_of(task: Task) -> str:
    count = task.fields.get("count") or (f"{task.completed:.0f} of {task.total:.0f}" if task.total is not None else "")
    return f"{task.description}: {count or 'working'}, {format_duration(task.elapsed or 0.0)}"


class _ReportingStatus(Status):
    """A spinner on a terminal; elsewhere a line every 30 seconds. Arguments are those of ``Status``."""

    def __init__(self, status: Any, *, console: Console, **options: Any) -> None:
        super().__init__(status, console=console, **options)
        self._began_s = time.monotonic()
        self._reporter = _Reporter(console, lambda: [f"{self.status}: {format_duration(self._seconds)}"])

    @property
    def _seconds(self) -> float:
        return time.monotonic() - self._began_s

    def start(self) -> None:
        super().start()
        self._reporter.start()

    def stop(self) -> None:
        self._reporter.stop()
        super().stop()


class _Console(Console):
    """A console that shows control characters in data as escape sequences, instead of sending them to the terminal."""

    def status(self, status: Any, **options: Any) -> Status:
        return _ReportingStatus(status, console=self, **options)

    def render_str(self, text: str, **options: Any) -> Text:
        return super().render_str(_printable(text), **options)  # before widths are measured

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterator[Segment]:
        for segment in super().render(renderable, options):
            yield segment if segment.control else segment._replace(text=_printable(segment.text))


def _printable(text: str) -> str:
    return text if text.isprintable() else "".join(map(_shown, text))


def _shown(character: str) -> str:
    return character if character.isprintable() or character in _SPACE else ascii(character)[1:-1]


def make_console(**options: Any) -> Console:
    """A console that shows strings as they are, as names of files and scenes may look like Rich's markup or emoji.

    Control characters are shown as escape sequences. Styles are given with ``rich.text.Text``. Only the labels of
    ``Console.status`` are markup nevertheless.

    Args:
        options: Further options of ``rich.console.Console``.
    """
    return _Console(markup=False, emoji=False, **options)


def table_console() -> Console:
    """A console for tables on standard output; in a pipe or file it is wide enough for them."""
    console = make_console()
    return console if console.is_terminal else make_console(width=_PIPE_WIDTH)


def counting_progress(console: Console, *more: ProgressColumn, transient: bool = True) -> Progress:
    """A progress display over the full width that counts finished items, with further columns at its end."""
    columns = (DESCRIPTION, BarColumn(bar_width=None), MofNCompleteColumn(), *more)
    return ReportingProgress(*columns, console=console, expand=True, transient=transient)


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
        yield Bar(progress, progress.add_task(label, total=total))


@contextmanager
def percent_bar(label: str, console: Console, total: int | None = None, *, hidden: bool = False) -> Iterator[Bar]:
    """Show a short bar with a percentage while the context is open, and remove it at the end."""
    columns = (DESCRIPTION, BarColumn(), TaskProgressColumn(), TimeRemainingColumn())
    with ReportingProgress(*columns, console=console, transient=True, disable=hidden) as progress:
        yield Bar(progress, progress.add_task(label, total=total))


class TickRate(ProgressColumn):
    """Recent ticks per second."""

    def render(self, task: Task) -> Text:
        """The text of the column."""
        speed = task.finished_speed or task.speed
        return Text("" if speed is None else f"{speed:.1f} ticks/s", style="progress.data.speed")


def own_command() -> str:
    """How this command was called, for what is printed: ``./simbev`` in a checkout, or ``simbev``."""
    return os.environ.get("SIMBEV_COMMAND", "simbev")


def format_size(size_bytes: float) -> str:
    """A size in decimal units, such as ``1.5 GB``."""
    return decimal(round(size_bytes))


def format_duration(duration_s: float) -> str:
    """A rounded duration in s, min or h."""
    minutes = round(duration_s / 60.0)
    return f"{duration_s:.0f} s" if minutes < 2 else f"{minutes} min" if minutes < 120 else f"{minutes / 60:.1f} h"
