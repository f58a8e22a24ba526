"""Works on the newest item in a thread of its own: what a live stack does when it is slower than its input."""

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Item = TypeVar("Item")


class NewestOnly(Generic[Item]):
    """Calls a function with one item after the other; an item that waits is dropped when a newer one comes.

    Args:
        work: The function.
    """

    def __init__(self, work: Callable[[Item], None]) -> None:
        self._work = work
        self._changed = threading.Condition()
        self._waiting: list[Item] = []
        self._is_closed = False
        self._failure: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def put(self, item: Item) -> None:
        """Hand over an item, and raise what the function has raised, if it has."""
        with self._changed:
            if self._failure is not None:
                raise self._failure
            self._waiting[:] = [item]
            self._changed.notify()

    def close(self) -> None:
        """Drop the item that waits and end the thread when the function returns."""
        with self._changed:
            self._is_closed = True
            self._waiting.clear()
            self._changed.notify()
        self._thread.join()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._is_closed)
                if self._is_closed:
                    return
                item = self._waiting.pop()
            try:
                self._work(item)
            except BaseException as error:  # passed on to the thread that hands over the next item
                self._failure = error
                return
