"""The referee node: infractions as they begin and scores until the drive ends, whatever the driver does."""

import json
from collections import defaultdict
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from drive_cases import EGO_ID, TICK_S, actor, braking, drive, network, spec, state, straight
from made_up_scene import made_up_spec
from started_nodes import started_node
from std_msgs.msg import String

from simbev_ros.evaluation.driving.figures import drive_figures
from simbev_ros.evaluation.driving.static_world import SolidMesh
from simbev_ros.ros.msgs.topics import manifest
from simbev_ros.ros.nodes import referee_node
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec

WALL = SolidMesh(np.array([[[120.0, -5.0, 0.0], [120.0, 5.0, 0.0], [120.0, 0.0, 3.0]]]))


@pytest.fixture(autouse=True)
def _street() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(referee_node, "load_network", lambda _: network())
        patch.setattr(referee_node, "load_static_world", lambda *_: WALL)
        yield


def play(node: Any, scene: SceneSpec, at: Any, seconds: float) -> dict[str, list[dict[str, Any]]]:
    """What the node publishes, by topic; it must report every tick."""
    sent, finished = defaultdict[str, list[Any]](list), []
    node.spec = scene
    node.publish = lambda name, message: sent[name].append(json.loads(message.data))
    node.report_finished = lambda _, tick: finished.append(tick)
    ticks = range(-1, round(seconds / TICK_S))
    for tick in ticks:
        seen = state(scene, tick, [actor(EGO_ID, at, tick * TICK_S)])
        node.process(scene, seen)
        node.finish(scene, seen)
    assert finished == [*ticks]
    return sent


def test_what_the_node_publishes_is_what_the_referee_finds() -> None:
    scene = spec()
    referee, found = drive(straight(12.0), 14.0, scene, network())
    with started_node("referee", scene) as node:
        assert node.topics == ["/drive/events", "/drive/score"]
        assert {*node.topics} < {topic.name for topic in manifest(scene, compressed_images=True)}
        sent = play(node, scene, straight(12.0), 14.05)
    (hit,) = sent["/drive/events"]
    assert (found, hit["kind"], hit["position_m"][0]) == ([], "collision_static", pytest.approx(118.0, abs=0.6))
    assert hit["stamp_ns"] == scene.stamp_ns(hit["tick"])
    scores = sent["/drive/score"]
    stamps = [each.pop("stamp_ns") for each in scores]
    assert scene.stamp_ns(hit["tick"]) in stamps
    assert [*np.diff(sorted({*stamps} - {scene.stamp_ns(hit["tick"])}))] == [500_000_000] * 27
    expected = drive_figures(referee.record)
    assert scores[0]["scores"]["leaderboard_2_0"]["infraction_penalty"] == 1.0
    assert scores[-1]["scores"]["leaderboard_2_0"]["infraction_penalty"] == 0.65
    assert scores[-1]["completed"] == pytest.approx(expected["completed"], abs=0.01)


def test_the_score_of_a_driver_that_stops_says_so() -> None:
    scene = spec(standstill_s=5.0)
    with started_node("referee", scene) as node:
        sent = play(node, scene, braking(10.0, 5.0, 3.0), 12.0)
    assert [each["kind"] for each in sent["/drive/events"]] == ["discomfort", "standstill"]
    assert sent["/drive/score"][-1]["ended"] == "standstill"
    assert 0.0 < sent["/drive/score"][-1]["scores"]["leaderboard_2_1"]["driving_score"] < 100.0


@pytest.mark.parametrize("is_early", [False, True])
def test_the_last_tick_of_a_scene_has_one_score_whatever_ends_it(is_early: bool) -> None:
    """The end may arrive before or after the last tick, here the fifth one."""
    scene = spec()
    with started_node("referee", scene) as node:
        node.read_end = lambda _: SceneEnd(scene=scene.name, tick=4, reason="interrupted")
        node.spec = scene
        if is_early:
            node._on_end(String())
        sent = play(node, scene, straight(12.0), 5 * TICK_S)
        assert bool(sent) is is_early
        node._on_end(String())
    assert [each["stamp_ns"] for each in sent["/drive/score"]] == [scene.stamp_ns(4)]


def test_a_scene_without_a_drive_has_no_referee() -> None:
    scene = made_up_spec([])
    with started_node("referee", scene) as node:
        assert node.topics == []
        assert play(node, scene, straight(5.0), 1.0) == {}
