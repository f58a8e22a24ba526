"""A bag in both forms: foreign readers find in typed messages what is in the tables."""

import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Command, record
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.files.structured_text import load_yaml
from simbev_ros.foundation.types import Table
from simbev_ros.recording.arrays import point_array
from simbev_ros.recording.layout import locate_mcap
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.schema.messages.message_types import type_hash
from simbev_ros.schema.messages.table_messages import RADAR_SCAN, TABLE_TYPES, row_layout, table_of

pytestmark = pytest.mark.graph

TYPED = {
    "/world/scene/typed": "simbev_interfaces/msg/Scene",
    "/world/events/typed": "simbev_interfaces/msg/SceneEvent",
    "/world/actors/typed": "simbev_interfaces/msg/Actors",
    "/world/signals/typed": "simbev_interfaces/msg/TrafficSignals",
    "/world/weather/typed": "simbev_interfaces/msg/Weather",
    "/ego/hd_map/typed": "simbev_interfaces/msg/LaneRecord",
    "/ego/boxes/typed": "simbev_interfaces/msg/Boxes",
    "/ego/cam_front/boxes/typed": "simbev_interfaces/msg/Views",
}
GUIDE = Path(__file__).parents[3] / "docs/guide/datasets.md"
TABLES = [name for name, kind in TYPED.items() if kind in TABLE_TYPES]


def stamp_of(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


@pytest.fixture(scope="module")
def tables(recorded: Path) -> dict[str, dict[int, Table]]:
    """Tables of the bag by topic and stamp."""
    with SceneBag(recorded) as bag:
        names = [name.removesuffix("/typed") for name in TABLES]
        found: dict[str, dict[int, Table]] = {name: {} for name in names}
        for message in bag.messages(names):
            found[message.topic][message.stamp_ns] = point_array(bag.decode(message))
    return found


def test_every_typed_message_is_accounted_for(recorded: Path) -> None:
    assert verify_bag(recorded) == []
    with SceneBag(recorded) as bag:
        counts = {name: len(topic.stamps_ns) for name, topic in bag.topics.items()}
        expected = bag.counts("expected") or {}
    assert {name for name in counts if name.endswith("/typed")} == TYPED.keys()
    for name in TYPED:
        assert expected[name] == counts[name] == counts[name.removesuffix("/typed")], name
    assert counts["/world/actors/typed"] == 10


def test_types_and_hashes_are_in_the_metadata(recorded: Path) -> None:
    topics = load_yaml(recorded / "metadata.yaml")["rosbag2_bagfile_information"]["topics_with_message_count"]
    found = {each["topic_metadata"]["name"]: each["topic_metadata"] for each in topics}
    for name, kind in TYPED.items():
        assert (found[name]["type"], found[name]["type_description_hash"]) == (kind, type_hash(kind))
        source = found[name.removesuffix("/typed")]
        assert found[name]["offered_qos_profiles"] == source["offered_qos_profiles"]


def rosbags_messages(bag: Path) -> Iterator[tuple[str, int, Any]]:
    """Messages as rosbags reads them with the definitions in the bag."""
    with AnyReader([bag], default_typestore=get_typestore(Stores.EMPTY)) as reader:
        for connection, stamp_ns, payload in reader.messages():
            if connection.topic in TYPED:
                yield connection.topic, stamp_ns, reader.deserialize(payload, connection.msgtype)


def test_rosbags_reads_the_rows_of_the_tables_with_the_definitions_in_the_bag(
    recorded: Path, tables: dict[str, dict[int, Table]]
) -> None:
    seen, rows = set(), 0
    for topic, stamp_ns, message in rosbags_messages(recorded):
        assert stamp_of(message) == stamp_ns
        if topic in TABLES:
            table = tables[topic.removesuffix("/typed")][stamp_ns]
            assert table_of(TYPED[topic], message).tobytes() == table.tobytes()
            seen.add((topic.removesuffix("/typed"), stamp_ns))
            rows += len(table)
    assert seen == {(name, stamp_ns) for name, found in tables.items() for stamp_ns in found} and rows > 300


def test_the_reader_of_mcap_reads_the_rows_of_the_tables(recorded: Path, tables: dict[str, dict[int, Table]]) -> None:
    reader = pytest.importorskip("mcap_ros2.reader")
    seen = set()
    for each in reader.read_ros2_messages(str(locate_mcap(recorded)), topics=list(TYPED)):
        topic, message = each.channel.topic, each.ros_msg
        seen.add(topic)
        if topic in TABLES:
            sequence, fields, dtype, _ = row_layout(TYPED[topic])
            rows = [tuple(getattr(row, name) for name in fields) for row in getattr(message, sequence)]
            expected = tables[topic.removesuffix("/typed")][stamp_of(message)]
            assert np.array(rows, dtype).tobytes() == expected.tobytes()
    assert seen == TYPED.keys() - {"/world/events/typed"}


def test_the_snippet_of_the_guide_prints_every_tick(
    recorded: Path, tables: dict[str, dict[int, Table]], capsys: pytest.CaptureFixture[str]
) -> None:
    (snippet,) = re.findall(r"```python\n(.*?AnyReader.*?)```", GUIDE.read_text(encoding="utf-8"), re.DOTALL)
    exec(snippet.replace("datasets/first/scenes/train/Blocks-0000", str(recorded)), {})
    lines = [line.split() for line in capsys.readouterr().out.splitlines()]
    expected = {stamp_ns: len(table) for stamp_ns, table in tables["/world/actors"].items()}
    assert {int(stamp_ns): int(count) for stamp_ns, count, _, _ in lines} == expected


def test_the_dataset_reader_gives_the_same_tables_recorded(recorded: Path) -> None:
    (scene,) = open_dataset(recorded).scenes
    frame = scene[2]
    for key in ("boxes", "cam_front/boxes", "world/actors", "world/signals"):
        assert frame[f"{key}/typed"].tobytes() == frame[key].tobytes()
        assert frame[f"{key}/typed"].dtype == frame[key].dtype
    assert frame["hd_map/typed"].id == frame["hd_map"]["id"]
    assert scene.constants["world/scene/typed"].name == "Blocks-0000"


def test_a_scan_of_a_radar_is_recorded_in_any_form_and_with_or_without_its_message_package(
    small_config: Callable[..., Path], tmp_path: Path
) -> None:
    config = small_config(0.2, without=["camera", "lidar", "gnss", "imu"])
    config.write_text(config.read_text().replace("micro_doppler: true", "scan: true"))
    bag = record(Command, config, tmp_path / "dataset")
    assert verify_bag(bag) == []
    scene = open_dataset(tmp_path / "dataset").scenes[0]
    assert scene.sources["radar_front/scan"].type_name == RADAR_SCAN
    scan, cloud = scene[2]["radar_front/scan"], scene[2]["radar_front/points"]
    assert len(scan) > 50
    assert all(np.array_equal(scan[name], cloud[name]) for name in scan.dtype.names)
