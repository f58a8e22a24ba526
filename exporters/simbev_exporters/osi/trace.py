"""Trace files of OSI: MCAP by the rules of ASAM OSI 3.8, "Multi channel trace file format", with one channel.

Messages in order of time enter, one by one; a file leaves.
"""

from collections.abc import Iterable
from typing import BinaryIO

from google.protobuf import __version__ as protobuf_version
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from mcap_protobuf.schema import build_file_descriptor_set
from osi3.osi_groundtruth_pb2 import GroundTruth

from simbev_exporters.osi.ground_truth import osi_version
from simbev_ros import __version__
from simbev_ros.foundation.units import NS_PER_S

TOPIC = "GroundTruth"
_TRACE = "net.asam.osi.trace"
_EPOCH = "1970-01-01T00:00:00Z"
"""Simulated time of stamp 0."""


def write_trace(file: BinaryIO, messages: Iterable[GroundTruth], description: str) -> None:
    """Write a trace file of ground truth; in memory are about 1 MiB of messages.

    Args:
        file: The file, empty.
        messages: The messages in order of time.
        description: Text about the data.
    """
    osi = version_text()
    writer = Writer(file, compression=CompressionType.ZSTD)
    writer.start(profile="", library=f"simbev_ros {__version__}")
    versions = {
        "version": osi,
        "min_osi_version": osi,
        "max_osi_version": osi,
        "min_protobuf_version": protobuf_version,
        "max_protobuf_version": protobuf_version,
    }
    about = {"zero_time": _EPOCH, "description": description, "data_sources": f"simbev_ros {__version__}"}
    writer.add_metadata(_TRACE, {**versions, **about})
    schema = build_file_descriptor_set(GroundTruth).SerializeToString(deterministic=True)
    name = GroundTruth.DESCRIPTOR.full_name
    schema_id = writer.register_schema(name=name, encoding=SchemaEncoding.Protobuf, data=schema)
    channel = {
        f"{_TRACE}.channel.osi_version": osi,
        f"{_TRACE}.channel.protobuf_version": protobuf_version,
        f"{_TRACE}.channel.description": "Ground truth of each tick in the map frame; lanes are in the first message",
    }
    encoding = MessageEncoding.Protobuf
    channel_id = writer.register_channel(topic=TOPIC, message_encoding=encoding, schema_id=schema_id, metadata=channel)
    for message in messages:
        stamp_ns = message.timestamp.seconds * NS_PER_S + message.timestamp.nanos
        data = message.SerializeToString(deterministic=True)
        writer.add_message(channel_id=channel_id, log_time=stamp_ns, publish_time=stamp_ns, data=data)
    writer.finish()


def version_text() -> str:
    """Version of OSI, as in 3.8.0."""
    return ".".join(map(str, osi_version()))


def trace_name(start: str, count: int, name: str) -> str:
    """Name of a trace file by OSI's convention.

    Args:
        start: Time of the first message, as in 20210818T150542Z.
        count: Number of messages.
        name: Name of the trace.
    """
    osi, protobuf = (version.replace(".", "") for version in (version_text(), protobuf_version))
    return f"{start}_gt_{osi}_{protobuf}_{count}_{name}.mcap"
