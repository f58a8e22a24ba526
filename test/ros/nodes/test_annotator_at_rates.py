"""An annotator whose labels have a rate: they are those of the same ticks, and nothing is done in between."""

import json
from collections.abc import Iterator
from typing import Any

import pytest
from annotated_agents import TICKS, events, play, published, scene, small_world, state_at
from started_nodes import started_node

from simbev_ros.ros.msgs.stamps import stamp_of
from simbev_ros.schema.scene.spec import SceneSpec


@pytest.fixture(scope="module", autouse=True)
def loaded_world() -> Iterator[None]:
    with small_world():
        yield


def with_label_rates(**rates_hz: float) -> SceneSpec:
    """The scene with other rates of the labels of some agents."""
    data = scene().model_dump(mode="json")
    for agent in data["agents"]:
        agent["annotation"]["rate_hz"] = rates_hz.get(agent["rig"]["agent"])
    return SceneSpec.model_validate(data)


@pytest.mark.parametrize("scope", [["boxes", "views", "surroundings"], ["views"], ["surroundings"]])
@pytest.mark.parametrize("rates_hz", [{"ego": 5, "car": 5, "rsu": 5}, {"ego": 10, "rsu": 5}])
@pytest.mark.parametrize("seed", range(2))
def test_labels_at_a_rate_are_those_of_the_same_ticks(scope: list[str], rates_hz: dict[str, float], seed: int) -> None:
    own = f"[{','.join(scope)}]"
    sent, every_tick = published(with_label_rates(**rates_hz), seed, scope=own), published(scene(), scope=own)
    assert sent.pop("finished") == every_tick.pop("finished") == list(TICKS)
    expected = {name: kept(messages, rates_hz.get(name.split("/")[1])) for name, messages in every_tick.items()}
    assert sent == expected
    assert sum(map(len, sent.values())) < sum(map(len, every_tick.values()))


def kept(messages: list[Any], rate_hz: float | None) -> list[Any]:
    """Messages at ticks that have labels at a rate."""
    period_ns = scene().tick_ns * (1 if rate_hz is None else round(20 / rate_hz))
    return [message for message in messages if (stamp_ns_of(message) - scene().start_ns) % period_ns == 0]


def stamp_ns_of(message: Any) -> int:
    if not hasattr(message, "header"):
        return int(json.loads(message.data)["stamp_ns"])
    return stamp_of(message.header.stamp)


def test_nothing_is_labeled_or_read_at_a_tick_without_labels(monkeypatch: pytest.MonkeyPatch) -> None:
    spec = with_label_rates(ego=10, car=10, rsu=10)
    done: list[str] = []
    with started_node("annotator", spec, compressed=False) as node:
        for agent in node._agents:
            for name in ("boxes", "surroundings"):
                monkeypatch.setattr(agent.annotator, name, lambda *_, name=name: done.append(name))
        monkeypatch.setattr(node, "_read_sensor", lambda *_: done.append("read"))
        sent = play(node, spec, events(spec, [state_at(1), state_at(3)]))
        assert (done, sent) == ([], {"finished": [1, 3]})
        assert [node.is_due(spec, tick) for tick in TICKS] == [True, False, True, False]


def test_a_sensors_period_follows_from_the_scene_and_not_from_an_earlier_one() -> None:
    slow, fast = with_label_rates(ego=5, car=5, rsu=5), scene()
    with started_node("annotator", slow, compressed=False) as node:
        play(node, slow, events(slow, [state_at(0)]))
        node.start_scene(fast)
        sent = play(node, fast, events(fast, [state_at(tick) for tick in TICKS]))
    assert sent["finished"] == list(TICKS) and len(sent["/ego/boxes"]) == len(TICKS)
