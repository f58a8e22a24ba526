"""Another DDS receives the topics of a running graph, with types that a test declares itself: Cyclone DDS from PyPI."""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import SCENE, Simbev, write_small
from ros_domain import DOMAIN

from simbev_ros.recording.reader import SceneBag

pytest.importorskip("cyclonedds", reason="Cyclone DDS is not installed: pip install cyclonedds==11.0.1")
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.idl import IdlStruct, types
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

pytestmark = [pytest.mark.graph, pytest.mark.slow]

LOCAL = """<CycloneDDS><Domain>
<General><Interfaces><NetworkInterface name="lo"/></Interfaces></General>
<Discovery>
<ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>99</MaxAutoParticipantIndex>
<Peers><Peer address="127.0.0.1"/></Peers>
</Discovery>
</Domain></CycloneDDS>"""
"""The interface as in config/cyclonedds.xml, and what ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST adds to it."""
QOS = Qos(
    Policy.Reliability.Reliable(0),
    Policy.History.KeepLast(100),
    Policy.DataRepresentation(use_cdrv0_representation=True),
)


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: types.int32
    nanosec: types.uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Image(IdlStruct, typename="sensor_msgs::msg::dds_::Image_"):
    header: Header
    height: types.uint32
    width: types.uint32
    encoding: str
    is_bigendian: types.uint8
    step: types.uint32
    data: types.sequence[types.uint8]


@dataclass
class PointField(IdlStruct, typename="sensor_msgs::msg::dds_::PointField_"):
    name: str
    offset: types.uint32
    datatype: types.uint8
    count: types.uint32


@dataclass
class PointCloud2(IdlStruct, typename="sensor_msgs::msg::dds_::PointCloud2_"):
    header: Header
    height: types.uint32
    width: types.uint32
    fields: types.sequence[PointField]
    is_bigendian: bool
    point_step: types.uint32
    row_step: types.uint32
    data: types.sequence[types.uint8]
    is_dense: bool


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: types.float64
    y: types.float64
    z: types.float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: types.float64
    y: types.float64
    z: types.float64
    w: types.float64


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: types.array[types.float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: types.array[types.float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: types.array[types.float64, 9]


TOPICS = {"/ego/cam_front/rgb/image_raw": Image, "/ego/lidar/points": PointCloud2, "/ego/imu/data": Imu}


def stamp_ns(message: Any) -> int:
    return int(message.header.stamp.sec) * 10**9 + int(message.header.stamp.nanosec)


def take_until(readers: dict[str, DataReader], ended: Callable[[], bool]) -> dict[str, dict[int, Any]]:
    """All messages by topic and stamp, until the graph has ended and nothing is left."""
    received: dict[str, dict[int, Any]] = {name: {} for name in readers}
    is_over = False
    while not is_over:
        is_over = ended()
        for name, reader in readers.items():
            samples = (each for each in reader.take(100) if isinstance(each, TOPICS[name]))  # others: a writer ended
            received[name] |= {stamp_ns(each): each for each in samples}
    return received


def test_cyclone_dds_receives_images_clouds_and_imu_as_they_are_recorded(simbev: Simbev, tmp_path: Path) -> None:
    config = write_small(tmp_path, 2.0, "recording: {images: raw}\n", without=["radar", "gnss"])
    with_settings = Domain(DOMAIN, LOCAL)
    participant = DomainParticipant(DOMAIN)
    readers = {
        name: DataReader(participant, Topic(participant, f"rt{name}", kind, qos=QOS), qos=QOS)
        for name, kind in TOPICS.items()
    }
    run = simbev("run", config, "--record", tmp_path / "recorded")
    received = take_until(readers, lambda: run.process.poll() is not None)
    code, output = run.finish()
    assert code == 0, output
    with SceneBag(tmp_path / "recorded" / SCENE) as bag:
        recorded = {name: {each.stamp_ns: bag.decode(each) for each in bag.messages([name])} for name in TOPICS}
    for name, messages in recorded.items():
        common = messages.keys() & received[name].keys()
        assert len(common) > len(messages) / 2, f"{name}: {len(common)} of {len(messages)}"
        for stamp in common:
            same(received[name][stamp], messages[stamp])
    (first, *_) = received["/ego/imu/data"].values()
    assert 9.0 < math.hypot(first.linear_acceleration.x, first.linear_acceleration.z) < 10.5
    del readers, participant, with_settings


def same(received: Any, recorded: Any) -> None:
    """Check that all fields of a message are equal, and those of the messages in it."""
    for name in (field.name for field in fields(received)):
        value, other = getattr(received, name), getattr(recorded, name)
        if isinstance(value, IdlStruct):
            same(value, other)
        elif isinstance(value, list) and value and isinstance(value[0], IdlStruct):
            assert len(value) == len(other)
            for one, two in zip(value, other, strict=True):
                same(one, two)
        else:
            assert np.array_equal(value, other), name
