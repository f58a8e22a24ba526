"""Hands frames from one thread to another; one that is not taken in time is replaced by the next."""

from threading import Condition

from simbev_ros.show.rerun.live.live_frame import LiveFrame


class NewestFrame:
    """A place for one frame, in which a newer frame replaces an older one; putting never waits."""

    def __init__(self) -> None:
        self._condition, self._frame = Condition(), list[LiveFrame]()

    def put(self, frame: LiveFrame) -> None:
        """Offer a frame."""
        with self._condition:
            self._frame[:] = [frame]
            self._condition.notify()

    def take(self, timeout_s: float) -> LiveFrame | None:
        """Take the frame, or wait for one; None if none comes in time."""
        with self._condition:
            self._condition.wait_for(lambda: bool(self._frame), timeout_s)
            return self._frame.pop() if self._frame else None
