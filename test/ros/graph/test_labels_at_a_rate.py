"""A graph with labels at a rate: the labels of a tick are those of a graph that labels every tick, byte for byte."""

import json
from collections import defaultdict
from pathlib import Path

import pytest
from commands import Config, Simbev, record

from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.msgs.annotation_topics import annotation_topics
from simbev_ros.schema.scene.agents import agent_view

pytestmark = [pytest.mark.graph, pytest.mark.slow]

PERIOD = 4
FOR_LABELS = ("/ego/cam_front/instance/", "/ego/lidar/points", "/ego/radar_front/points")
"""Topics that only the annotator reads if they are not recorded."""
EXCLUDED = f"recording: {{topics: {{exclude: {json.dumps([f'{name}*' for name in FOR_LABELS])}}}}}\n"


def labeled_at_5_hz(config: Path) -> Path:
    config.write_text(config.read_text().replace("annotation:\n", "annotation:\n  rate_hz: 5\n"))
    return config


def messages_of(bag: Path) -> dict[str, dict[int, list[bytes]]]:
    """Messages by topic and tick; those between two ticks belong to the earlier one."""
    found: dict[str, dict[int, list[bytes]]] = defaultdict(lambda: defaultdict(list))
    with SceneBag(bag) as opened:
        assert opened.spec is not None
        for message in opened.messages():
            found[message.topic][opened.spec.tick_of(message.stamp_ns)].append(bytes(message.data))
    return {topic: dict(by_tick) for topic, by_tick in found.items()}


def test_labels_of_a_tick_do_not_depend_on_their_rate(
    recorded: Path, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    bag = record(simbev, labeled_at_5_hz(small_config(more=EXCLUDED)), tmp_path / "out")
    with SceneBag(bag) as opened:
        assert opened.spec is not None
        labels = annotation_topics(agent_view(opened.spec)).recorded
        assert opened.custom_data["complete"] == "true"
    assert {topic.period_ticks for topic in labels} == {PERIOD} and verify_bag(bag) == []
    found, every_tick = messages_of(bag), messages_of(recorded)
    for topic in labels:
        expected = {tick: messages for tick, messages in every_tick[topic.name].items() if tick % PERIOD == 0}
        assert list(expected) == [0, 4, 8] and found[topic.name] == expected, topic.name
    others = found.keys() - {topic.name for topic in labels} - {"/world/scene"}
    assert {name for name in others if found[name] != every_tick[name]} == set()
    left_out = every_tick.keys() - found.keys()
    assert {name for name in left_out if not name.startswith(FOR_LABELS) and not name.endswith("/typed")} == set()
    code, output = simbev("replay", recorded, labeled_at_5_hz(small_config()), "--out", tmp_path / "again").finish()
    assert code == 0, output
    again = messages_of(tmp_path / "again/scenes/train/Blocks-0000")
    assert {topic.name for topic in labels if again[topic.name] != found[topic.name]} == set()


def test_a_stack_is_evaluated_at_the_ticks_with_labels(simbev: Simbev, small_config: Config, tmp_path: Path) -> None:
    config = labeled_at_5_hz(small_config(without=["camera", "radar", "gnss", "imu"]))
    more = ("--stack", "reference", "--record", tmp_path / "out", "--evaluate", tmp_path / "figures.json")
    code, output = simbev("run", config, *more).finish()
    assert code == 0, output
    figures = json.loads((tmp_path / "figures.json").read_text())
    names = ("evaluated", "answered_boxes", "answered_grids", "missed", "without_truth")
    assert [figures["frames"][name] for name in names] == [3, 3, 3, 0, 0]
