"""The interface through which production reports progress, to a terminal or to a Python program."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from simbev_ros.production.events import ProductionEvent, StepEnded, StepStarted


class ProductionObserver(Protocol):
    """Receives the progress of playing scenes and making datasets, as events from ``production.events``.

    Example:
        >>> class Printer(ProductionObserver):
        ...     def notify(self, event: ProductionEvent) -> None:
        ...         if isinstance(event, SceneMade):
        ...             print(f"{event.entry.name} is ready")
    """

    def notify(self, event: ProductionEvent) -> None:
        """Called for each event, in the thread that called production; should return quickly."""


class _Silent(ProductionObserver):
    """Ignores everything."""

    def notify(self, event: ProductionEvent) -> None:
        """Do nothing."""


SILENT = _Silent()
"""The default observer, which ignores everything."""


class SeveralObservers(ProductionObserver):
    """Passes every event on to several observers, in their order.

    Args:
        observers: They receive the events.
    """

    def __init__(self, *observers: ProductionObserver) -> None:
        self._observers = observers

    def notify(self, event: ProductionEvent) -> None:
        """Pass the event on."""
        for observer in self._observers:
            observer.notify(event)


@contextmanager
def observe_step(observer: ProductionObserver, step: str) -> Iterator[None]:
    """Report a step of unknown length for as long as the context is open."""
    observer.notify(StepStarted(step))
    try:
        yield
    finally:
        observer.notify(StepEnded())
