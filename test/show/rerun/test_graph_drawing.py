"""Frames of a running graph reach Rerun's server; a stalled server holds up nothing but the thread that draws."""

import os
import signal
import time
from threading import Event

import pytest
from made_up_scene import SENSORS, made_up_spec
from waiting import PATIENCE_S

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")

from simbev_ros.ros.msgs.topic import Topic
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.show.rerun.live.graph_drawing import GraphDrawing
from simbev_ros.show.rerun.live.live_frame import LiveFrame, LiveScene, Payloads
from simbev_ros.show.rerun.live.newest_frame import NewestFrame
from simbev_ros.show.rerun.server import ViewerServer
from simbev_ros.show.rerun.subject import Detail

SPEC = made_up_spec(SENSORS, ticks=100)


class Notes:
    """Remembers what is reported."""

    def __init__(self) -> None:
        self.shown, self.ignored, self.is_shown = list[str](), list[str](), Event()

    def graph_noticed(self, is_there: bool) -> None:
        raise AssertionError("nobody watches a graph")

    def scene_shown(self, name: str) -> None:
        self.shown.append(name)
        self.is_shown.set()

    def messages_ignored(self, reason: str) -> None:
        self.ignored.append(reason)


def test_a_stalled_server_holds_up_only_the_drawing_which_ends_with_it() -> None:
    frames, notes = NewestFrame(), Notes()
    drawing = GraphDrawing(frames, Detail(100, layers=False), notes)
    with ViewerServer(0, "127.0.0.1", 64 << 20) as server:
        drawing.start(server.data_url)
        frames.put(LiveFrame(LiveScene(agent_view(SPEC), 0), 0, [], 10.0))
        assert notes.is_shown.wait(PATIENCE_S) and notes.shown == [SPEC.name]
        os.kill(server.pid, signal.SIGSTOP)
        for run in range(1, 4):  # each begins a recording
            frames.put(LiveFrame(LiveScene(agent_view(SPEC), run), 0, [], 10.0))
            time.sleep(0.1)
        assert notes.shown == [SPEC.name]
        drawing.end()
    drawing.join()
    assert not drawing._thread.is_alive()
    drawing.raise_failure()


def test_messages_that_cannot_be_drawn_are_reported_once_and_the_rest_is_drawn() -> None:
    frames, notes = NewestFrame(), Notes()
    drawing = GraphDrawing(frames, Detail(100, layers=False), notes)
    scene = LiveScene(agent_view(SPEC), 0)
    bad = Payloads(Topic("/ego/boxes", "sensor_msgs/msg/PointCloud2"), [b"nonsense"])
    with ViewerServer(0, "127.0.0.1", 64 << 20) as server:
        drawing.start(server.data_url)
        for tick in range(3):
            frames.put(LiveFrame(scene, tick, [bad], 10.0))
            assert notes.is_shown.wait(PATIENCE_S)
            time.sleep(0.2)
        drawing.end()
    drawing.join()
    drawing.raise_failure()
    assert sorted(each.partition(":")[0] for each in notes.ignored) == ["BoxDrawing", "PlotDrawing"]
