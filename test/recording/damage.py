"""An intact bag of a small scene, for tests that damage it."""

import json
from pathlib import Path

import numpy as np
from made_up_scene import SENSORS, made_up_spec
from ros_messages import image, string

from simbev_ros.recording.accounting import Accounting, Schedule
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.qos import QosProfile

TICK_NS = 50_000_000
TICKS = 30


def intact_bag(path: Path, split_bytes: int | None = None) -> Path:
    """Record images and stamped strings in many chunks, with attachments and the recorder's accounts."""
    rng = np.random.default_rng(1)
    topics = {"/cam/image_raw": "sensor_msgs/msg/Image", "/world/weather": "std_msgs/msg/String"}
    accounting = Accounting(dict.fromkeys(topics, Schedule()), start_ns=0, tick_ns=TICK_NS, ticks=TICKS)
    with SceneBagWriter(path, chunk_bytes=600, split_bytes=split_bytes) as writer:
        writer.add_attachment("scene.json", "application/json", made_up_spec(SENSORS).model_dump_json().encode())
        for topic, kind in topics.items():
            writer.add_topic(topic, kind, QosProfile(depth=7))
        for tick in range(TICKS):
            stamp_ns = tick * TICK_NS
            pixels = rng.integers(0, 256, (8, 24), np.uint8)
            payloads = image(stamp_ns, "mono8", pixels), string(json.dumps({"stamp_ns": stamp_ns}))
            for topic, payload in zip(topics, payloads, strict=True):
                accounting.add_message(topic, stamp_ns)
                writer.write(topic, stamp_ns, payload)
        return writer.finish(accounting.report().custom_data(path.name))
