"""Rows of the index of a dataset: the settings, weather and contents of a finished scene, from its bag.

Columns about the ego, its rig and its labels are those of the scene's first agent.
"""

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from simbev_ros import __version__
from simbev_ros.config.camera import Camera
from simbev_ros.dataset.values import ODOMETRY_TYPE, in_ego_frame, value_of
from simbev_ros.foundation.errors import BagError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, bytes_of, mcap_files, scene_folder
from simbev_ros.recording.reader import SceneBag
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import FORMAT

Row = dict[str, Any]
"""A row by column."""

_HASHED_BYTES = 1 << 22


def index_row(bag_path: Path, dataset: Path) -> Row:
    """Index row of a finished bag.

    Raises:
        BagError: The bag cannot be read, is truncated, or holds another scene than its name says.
    """
    with SceneBag(bag_path) as bag:
        spec = bag.spec
        if spec is None:
            raise BagError(f"{bag_path}: it holds no scene")
        if not bag.closed:
            raise BagError(f"{bag_path}: it is cut off")
        if bag_path != scene_folder(dataset, spec.split, spec.name):
            raise BagError(f"{bag_path}: it holds scene {spec.split}/{spec.name}")
        facts = bag.custom_data
        return {
            "format": FORMAT,
            "path": str(bag_path.relative_to(dataset)),
            **_settings(spec),
            **_weather("", spec.weather),
            **_weather("final_", spec.final_weather),
            **_content(bag, spec),
            "ended": facts.get("ended", ""),
            "complete": facts.get("complete") == "true",
            "recorded_ticks": bag.recorded_ticks or spec.ticks,
            "bytes": bytes_of(bag_path),
            "sha256": sha256_of(bag_path),
            "config_sha256": hashlib.sha256(bag.attachments.get(CONFIG_ATTACHMENT, b"")).hexdigest(),
            "simbev_ros": __version__,
        }


def sha256_of(bag: Path) -> str:
    """Hexadecimal SHA-256 of the concatenated bytes of a bag's MCAP files.

    Raises:
        BagError: There is no bag.
    """
    digest = hashlib.sha256()
    for file in mcap_files(bag):
        with file.open("rb") as stream:
            while block := stream.read(_HASHED_BYTES):
                digest.update(block)
    return digest.hexdigest()


def _settings(spec: SceneSpec) -> Row:
    kinds = [hazard.kind for hazard in spec.hazards]
    return {
        "name": spec.name,
        "number": spec.number,
        "map": spec.map.name,
        "split": spec.split,
        "seed": spec.seed,
        "tick_s": spec.tick_ns / NS_PER_S,
        "ticks": spec.ticks,
        "vehicles": spec.count_of("vehicle"),
        "pedestrians": spec.count_of("pedestrian"),
        "accidents": sum(kind == "accident" for kind in kinds),
        "work_zones": sum(kind != "accident" for kind in kinds),
        "walker_cross_factor": spec.walker_cross_factor,
        "ego_blueprint": spec.vehicles[0].blueprint,
        "cameras": len(spec.agents[0].rig.of_type(Camera)),
    }


def _weather(prefix: str, weather: Weather | None) -> Row:
    return {f"{prefix}{name}": None if weather is None else getattr(weather, name) for name in Weather.model_fields}


def _content(bag: SceneBag, spec: SceneSpec) -> Row:
    """Count of messages; of the ego, counts of objects and boxes, and the length of its path."""
    counts = np.zeros((2, len(BOX_CLASSES)), np.int64)
    ids: set[int] = set()
    positions_m = []
    ego = spec.agents[0]
    boxes, odometry = (f"/{ego.name}/{name}" for name in ("boxes", "odom"))
    for message in bag.messages([boxes, odometry]):
        if message.topic == odometry:
            (row,) = in_ego_frame(value_of(ODOMETRY_TYPE, [bag.decode(message)]), ego.base_link_x_m)
            positions_m.append(row["position_m"])
            continue
        table = point_array(bag.decode(message))
        counts += [np.bincount(table["class"][rows], minlength=len(BOX_CLASSES)) for rows in (..., table["valid"] > 0)]
        ids.update(table["id"].tolist())
    steps_m = np.diff(np.array(positions_m).reshape(-1, 3), axis=0)
    return {
        "messages": sum(len(topic.stamps_ns) for topic in bag.topics.values()),
        "objects": len(ids),
        "ego_way_m": float(np.linalg.norm(steps_m, axis=1).sum()),
        **{f"boxes_{name}": int(count) for name, count in zip(BOX_CLASSES, counts[0], strict=True)},
        **{f"valid_{name}": int(count) for name, count in zip(BOX_CLASSES, counts[1], strict=True)},
    }
