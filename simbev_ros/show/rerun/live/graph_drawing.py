"""The thread that draws frames of a running graph; if Rerun's server stalls, only this thread waits."""

from threading import Event, Thread

import rerun as rr
import rerun.blueprint as rrb

from simbev_ros.ros.nodes.graph_node import MALFORMED
from simbev_ros.show.rerun.blueprint import scene_blueprint
from simbev_ros.show.rerun.drawings import layer_drawings, main_drawings
from simbev_ros.show.rerun.live.live_frame import LiveFrame
from simbev_ros.show.rerun.live.live_observer import LiveObserver
from simbev_ros.show.rerun.live.newest_frame import NewestFrame
from simbev_ros.show.rerun.plots import TICK_RATE
from simbev_ros.show.rerun.scene_log import TIME, SceneLog
from simbev_ros.show.rerun.subject import Detail, Drawing, Subject

_STEP_S = 0.5
_END_TIMEOUT_S = 5.0
_MAX_REASON_CHARACTERS = 200


class GraphDrawing:
    """Draws the newest frame, then the newest one again; each scene into a Rerun recording of its own.

    Args:
        frames: Where frames come from.
        detail: How much is drawn.
        observer: Receives what is shown, and what cannot be drawn.
    """

    def __init__(self, frames: NewestFrame, detail: Detail, observer: LiveObserver) -> None:
        self._frames, self._detail, self._observer = frames, detail, observer
        self._url, self._ended = "", Event()
        self._reported: set[str] = set()
        self._failure: Exception | None = None
        self._thread = Thread(target=self._run, name="drawing", daemon=True)

    def start(self, url: str) -> None:
        """Begin to draw for the server at an address."""
        self._url = url
        self._thread.start()

    def end(self) -> None:
        """Ask the thread to end; it ends with the server if not before."""
        self._ended.set()

    def join(self) -> None:
        """Wait for the end of the thread, for a few seconds."""
        if self._thread.ident is not None:
            self._thread.join(_END_TIMEOUT_S)

    def raise_failure(self) -> None:
        """Raise what has ended the thread."""
        if self._failure is not None:
            raise self._failure

    def _run(self) -> None:
        frame: LiveFrame | None = None
        try:
            while not self._ended.is_set():
                frame = frame or self._frames.take(_STEP_S)
                if frame is not None:
                    frame = self._draw_scene(frame)
        except Exception as error:
            if not self._ended.is_set():  # afterwards, the connection breaks when the server ends
                self._failure = error

    def _draw_scene(self, frame: LiveFrame) -> LiveFrame | None:
        """Draw frames of one scene; return the first one of the next scene, or None at the end."""
        scene = frame.scene
        subject = Subject(scene.view, detail=self._detail)
        with SceneLog(scene.view, f"-{scene.run}") as log:
            is_answered = any(key.startswith("prediction/bev") for key in frame)
            log.connect(self._url, _blueprint(subject, with_predictions=is_answered))
            drawings = main_drawings(log, subject) + (layer_drawings(log, subject) if self._detail.layers else [])
            following: LiveFrame | None = frame
            while not self._ended.is_set():
                if following is not None:
                    if following.scene is not scene:
                        return following
                    self._draw(log, drawings, following)
                    if following is frame:
                        self._observer.scene_shown(scene.view.scene.name)
                following = self._frames.take(_STEP_S)
        return None

    def _draw(self, log: SceneLog, drawings: list[Drawing], frame: LiveFrame) -> None:
        """Draw one frame, and wait until the server has all of it."""
        log.begin(frame.tick, frame.stamp_ns)
        if frame.ticks_per_s is not None:
            log.add(TICK_RATE, rr.Scalars(frame.ticks_per_s))
        for drawing in drawings:
            try:
                drawing.draw(frame)
            except MALFORMED as error:  # any process can send messages
                self._ignore(drawing, error)
        while not self._ended.is_set() and not log.is_flushed(_STEP_S):
            self._ended.wait(_STEP_S)

    def _ignore(self, drawing: Drawing, error: Exception) -> None:
        """Report the first messages that one kind of drawing cannot use."""
        kind = type(drawing).__name__
        if kind not in self._reported:
            self._reported.add(kind)
            words = f"{type(error).__name__}: {error!s:.{_MAX_REASON_CHARACTERS}}"
            self._observer.messages_ignored(f"{kind}: {words}")


def _blueprint(subject: Subject, *, with_predictions: bool) -> rrb.Blueprint:
    """The layout of a recorded scene, which follows the newest time."""
    blueprint = scene_blueprint(subject, with_predictions=with_predictions, is_live=True)
    blueprint.time_panel = rrb.TimePanel(state="collapsed", timeline=TIME, play_state="following")
    return blueprint
