"""Description of a bag for ``simbev info``: state, contents, topics and scene, as values that fit in JSON."""

from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from simbev_ros.config.camera import Camera
from simbev_ros.config.lidar import Lidar
from simbev_ros.config.radar import Radar
from simbev_ros.config.rig import SENSOR_KINDS, Rig
from simbev_ros.foundation.counts import plural
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.digest import scene_digest, topic_digests
from simbev_ros.recording.layout import bytes_of
from simbev_ros.recording.reader import SceneBag, Topic
from simbev_ros.schema.scene.agents import AgentView, agent_views
from simbev_ros.schema.scene.spec import SceneSpec

_ABBREVIATIONS = {"gnss": "GNSS", "imu": "IMU"}
"""Spelling in prose of sensor kinds that are abbreviations."""


def describe_bag(
    path: AnyPath, *, digest: bool, progress: Callable[[int, int], None] = lambda *_: None
) -> dict[str, Any]:
    """Describe a bag.

    Args:
        path: The bag's folder or file.
        digest: Whether to read the whole bag and add digests of its topics.
        progress: Called while digests are computed, with the number of messages read so far and their total.

    Returns:
        ``state`` is finished (closed, and under its own name), unfinished (closed, but not given its name) or cut off
        (its writer was killed); ``complete`` is the recorder's statement that nothing is missing, None without one;
        ``ended`` says why the scene ended, after ``ticks``, which may be fewer than the scene's; ``expected`` and
        ``bytes`` of a topic are None if the recorder left no accounts, ``rate_hz`` with fewer than two messages.
        ``agents`` of the scene are by name, in their order; ``rig`` is that of the first one.

    Raises:
        BagError: The bag cannot be read.
    """
    with SceneBag(path) as bag:
        start_ns, end_ns = bag.span_ns
        digests = _digests(bag, progress) if digest else {}
        description: dict[str, Any] = {
            "path": str(path),
            "name": bag.name,
            "state": "finished" if bag.finished else "unfinished" if bag.closed else "cut off",
            "complete": bag.fact("complete"),
            "ended": bag.custom_data.get("ended"),
            "ticks": bag.recorded_ticks,
            "problems": bag.fact("problems") or [],
            "file_bytes": bytes_of(path),
            "messages": sum(len(topic.stamps_ns) for topic in bag.topics.values()),
            "start_ns": start_ns,
            "duration_s": (end_ns - start_ns) / NS_PER_S,
            "scene": _scene(bag.spec) if bag.spec else None,
            "attachments": {name: len(data) for name, data in bag.attachments.items()},
            "topics": [_topic(topic, bag, digests) for topic in bag.topics.values()],
        }
    if digest:
        description["digest"] = scene_digest(digests)
    return description


def _digests(bag: SceneBag, progress: Callable[[int, int], None]) -> dict[str, str]:
    total = sum(len(topic.stamps_ns) for topic in bag.topics.values())
    done = 0

    def count(messages: int) -> None:
        nonlocal done
        done += messages
        progress(done, total)

    return topic_digests(bag, count)


def _topic(topic: Topic, bag: SceneBag, digests: Mapping[str, str]) -> dict[str, Any]:
    count = len(topic.stamps_ns)
    span_s = float(np.ptp(topic.stamps_ns)) / NS_PER_S if count else 0.0
    facts: dict[str, Any] = {
        "name": topic.name,
        "type": topic.type_name,
        "count": count,
        "expected": (bag.counts("expected") or {}).get(topic.name),
        "rate_hz": (count - 1) / span_s if span_s else None,
        "bytes": bag.payload_bytes.get(topic.name),
    }
    return facts | ({"digest": digests[topic.name]} if digests else {})


def _scene(spec: SceneSpec) -> dict[str, Any]:
    return {
        "map": spec.map.name,
        "split": spec.split,
        "seed": spec.seed,
        "ticks": spec.ticks,
        "tick_s": spec.tick_ns / NS_PER_S,
        "vehicles": spec.count_of("vehicle"),
        "pedestrians": spec.count_of("pedestrian"),
        "weather": spec.weather.model_dump(),
        "final_weather": None if spec.final_weather is None else spec.final_weather.model_dump(),
        "rig": _rig(spec.agents[0].rig),
        "agents": {view.agent: {"carrier": _carrier(view), "rig": _rig(view.rig)} for view in agent_views(spec)},
    }


def _carrier(view: AgentView) -> str:
    return "roadside unit" if view.vehicle is None else view.vehicle.blueprint


def _rig(rig: Rig) -> list[str]:
    """A phrase for each kind of sensor."""
    cameras: dict[str, int] = {}
    for camera in rig.of_type(Camera):
        kind = f"{camera.width_px}x{camera.height_px} {' '.join(camera.modalities)}"
        cameras[kind] = cameras.get(kind, 0) + 1
    phrases = [f"{plural(count, 'camera')} {kind}" for kind, count in cameras.items()]
    phrases += [f"lidar {lidar.channels}x{lidar.columns} {lidar.range_m:g} m" for lidar in rig.of_type(Lidar)]
    radars = Counter(
        f"{radar.range_m:g} m {radar.horizontal_fov_deg:g}x{radar.vertical_fov_deg:g}°"
        for each in rig.of_type(Radar)
        for radar in each.scans_of_cycle
    )
    phrases += [f"{plural(count, 'radar')} {kind}" for kind, count in radars.items()]
    others = {kind: model for kind, model in SENSOR_KINDS.items() if model not in (Camera, Lidar, Radar)}
    phrases += [_ABBREVIATIONS.get(kind, kind) for kind, model in others.items() for _ in rig.of_type(model)]
    return phrases
