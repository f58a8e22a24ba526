"""docs/reference/topics.md: every topic of the paper's rig with all labels, from the manifest of topics."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import Any

import yaml

from simbev_ros.config.annotation import Occupancy, VectorMapPatch
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.ros.msgs.qos import qos_of
from simbev_ros.ros.msgs.topics import Topic, manifest
from simbev_ros.ros.msgs.typed_topics import typed_topics
from simbev_ros.schema.scene.agent_spec import AgentSpec
from simbev_ros.schema.scene.spec import SceneSpec
from tools.docs.markdown import GENERATED, code, table

_DESCRIPTIONS = Path(__file__).with_name("topics.yaml")
_INTRODUCTION = """# Topics

All topics of the paper's rig (six cameras, a lidar, four radars, GNSS, IMU) with every label switched on. `ego` is the
agent's name (`rig.agent`). `cam_*` and `radar_*` stand for the names of the sensors in the rig.

All messages of a tick carry the same stamp. A rate is that of the paper's settings: a tick every 50 ms. A sensor with
`rate_hz` publishes at that rate instead.

QoS: *latched* is reliable and transient local with depth 1. In lockstep everything is reliable. With `--live`, sensor
topics are best effort with depth 5; `--reliable` and [ROS parameters](../guide/viewers.md#quality-of-service) change
that. A subscriber with the sensor-data profile receives both.
"""


@dataclass(frozen=True, slots=True)
class Description:
    """One row of the page: a topic, or several that a pattern stands for.

    Attributes:
        pattern: Fits names of the manifest.
        show: The name on the page.
        text: What the topic holds.
        given: Type, QoS and rate of a topic that is not in the manifest; empty for others.
    """

    pattern: str
    show: str
    text: str
    given: Mapping[str, Any]


def render_topics() -> str:
    """The whole page."""
    data, known = _data(), paper_topics()
    parts = [GENERATED, _INTRODUCTION]
    for group in data["groups"]:
        rows = [_row(description, known) for description in _descriptions(group["topics"])]
        text = f"{group['text']}\n\n" if "text" in group else ""
        parts.append(f"## {group['title']}\n\n{text}{table(('topic', 'type', 'rate', 'QoS', 'content'), rows)}")
    services = [(code(name), kind, text) for name, kind, text in data["services"]]
    parts.append(f"## Services\n\n{table(('service', 'type', 'effect'), services)}")
    return "\n".join(part.rstrip("\n") + "\n" for part in parts)


def descriptions() -> list[Description]:
    """All rows of the page."""
    return [each for group in _data()["groups"] for each in _descriptions(group["topics"])]


@lru_cache(maxsize=1)
def paper_topics() -> dict[str, Topic]:
    """By name all topics of the paper's rig with every label, images in both forms, and typed messages."""
    scenario = load_scenario("paper")
    labels = scenario.annotation.model_copy(update={"occupancy": Occupancy(), "vector_map": VectorMapPatch()})
    agent = AgentSpec(rig=scenario.rig, annotation=labels, vehicle=0)
    values: dict[str, Any] = {"agents": (agent,), "tick_ns": scenario.time.tick_ns}
    spec: SceneSpec = getattr(SceneSpec, "model_construct")(**values)  # noqa: B009 - topics need no more of a scene
    sent = [topic for form in (False, True) for topic in manifest(spec, compressed_images=form)]
    return {topic.name: topic for topic in (*sent, *(each.topic for each in typed_topics(spec)))}


def matching(description: Description, names: Sequence[str]) -> list[str]:
    """Names of the manifest that a row stands for; ``*`` does not cross a slash."""
    depth = description.pattern.count("/")
    return [name for name in names if name.count("/") == depth and fnmatchcase(name, description.pattern)]


def _data() -> Any:
    return yaml.safe_load(_DESCRIPTIONS.read_text(encoding="utf-8"))


def _descriptions(entries: Sequence[Mapping[str, Any]]) -> list[Description]:
    return [
        Description(
            pattern=each.get("pattern", ""),
            show=each.get("show") or each.get("pattern") or each["name"],
            text=each["text"],
            given=each if "name" in each else {},
        )
        for each in entries
    ]


def _row(description: Description, known: Mapping[str, Topic]) -> tuple[str, ...]:
    given = description.given
    if given:
        qos = given["qos"] if given["qos"] == "any" else _qos(given["qos"], given["durability"], given["depth"])
        qos += f", live {given['live']}" if "live" in given else ""
        return code(description.show), given["type"].replace("/msg/", "/"), given["when"], qos, description.text
    topic = known[matching(description, list(known))[0]]
    profile = qos_of(topic, live=False)
    qos = _qos(profile.reliability, profile.durability, profile.depth) + (", live best effort" if topic.sensor else "")
    return code(description.show), topic.type.replace("/msg/", "/"), _rate(topic), qos, description.text


def _qos(reliability: str, durability: str, depth: int) -> str:
    if durability in ("latched", "transient_local"):
        return "latched"
    return f"{reliability.replace('_', ' ')}, depth {depth}"


def _rate(topic: Topic) -> str:
    if topic.period_ticks == 0:
        return "once"
    if topic.sporadic:
        return "sporadic"
    hertz = topic.messages_per_tick * NS_PER_S / (topic.period_ticks * load_scenario("paper").time.tick_ns)
    return f"{hertz:g} Hz"
