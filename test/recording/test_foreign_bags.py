"""Bags that rosbags and rosbag2 have converted: attachments are gone, messages are not in chunks, or compressed."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
import zstandard
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from simbev_ros.config.load import parse_scenario
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.errors import BagError
from simbev_ros.maps.build import load_network
from simbev_ros.recording.layout import CONFIG_ATTACHMENT, locate_mcap
from simbev_ros.recording.reader import SceneBag
from simbev_ros.recording.repair import repair_bag
from simbev_ros.recording.verify import verify_bag
from simbev_ros.simulation.replay.replay import Replay, build_recorded_roads, replayed_spec


@pytest.fixture(scope="module")
def bag() -> Path:
    (bag,) = (Path(__file__).parent / "format_1/town/scenes").glob("*/*")
    return bag


def _rewrite(bag: Path, out: Path, payload: Callable[[bytes], bytes] = bytes, **options: object) -> Path:
    """Copy a bag's messages, without attachments, as rosbag2 does with the options of ``Writer``."""
    out.mkdir()
    with locate_mcap(bag).open("rb") as source, (out / f"{out.name}_0.mcap").open("wb") as target:
        writer = Writer(target, **options)  # type: ignore[arg-type]
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in make_reader(source).iter_messages():
            assert schema is not None
            if channel.topic not in channels:
                schema_id = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(
                    channel.topic, channel.message_encoding, schema_id, dict(channel.metadata)
                )
            writer.add_message(channels[channel.topic], message.log_time, payload(message.data), message.publish_time)
        writer.finish()
    return out


def _converted(bag: Path, out: Path) -> Path:
    _convert(bag, out, "mcap")
    return out


def _convert(bag: Path, out: Path, storage: str) -> None:
    command = [sys.executable, "-m", "rosbags.convert", "--src", bag, "--dst", out, "--dst-storage", storage]
    subprocess.run(command, check=True, capture_output=True)


PRESETS = {
    "none": {"compression": CompressionType.NONE},
    "fastwrite": {"use_chunking": False, "enable_crcs": False, "use_statistics": True},
    "zstd_fast": {"compression": CompressionType.ZSTD, "enable_crcs": False},
    "zstd_small": {"compression": CompressionType.ZSTD, "chunk_size": 1 << 22},
    "lz4": {"compression": CompressionType.LZ4},
}
FORMS: dict[str, Callable[[Path, Path], Path]] = {
    "rosbags": _converted,
    "message compression": lambda bag, out: _rewrite(bag, out, zstandard.ZstdCompressor().compress),
    **{name: lambda bag, out, name=name: _rewrite(bag, out, **PRESETS[name]) for name in PRESETS},  # type: ignore[misc]
}


@pytest.mark.parametrize("form", FORMS)
def test_a_converted_bag_is_read_and_repaired_as_the_original(bag: Path, tmp_path: Path, form: str) -> None:
    converted = FORMS[form](bag, tmp_path / "Blocks-0000")
    with SceneBag(bag) as original, SceneBag(converted) as copy:
        assert copy.spec == original.spec is not None
        assert {*copy.messages()} == {*original.messages()}
    (before,), (after,) = open_dataset(bag).scenes, open_dataset(converted).scenes
    assert len(before) == len(after) == 2 and before[1].keys() == after[1].keys()
    repaired = repair_bag(converted, tmp_path / "repaired")
    assert not repaired.lost
    with SceneBag(bag) as original, SceneBag(repaired.path) as copy:
        assert {*copy.messages()} == {*original.messages()}
    (fault,) = [each for each in verify_bag(repaired.path) if "Blocks" not in each.place and each.place != ""]
    assert "message counts are missing, as in bags that other programs have converted" in fault.problem


def test_files_that_are_compressed_as_a_whole_are_unpacked_by_repair(bag: Path, tmp_path: Path) -> None:
    packed = tmp_path / "packed"
    packed.mkdir()
    content = locate_mcap(bag).read_bytes()
    (packed / "packed_0.mcap.zstd").write_bytes(zstandard.ZstdCompressor().compress(content))
    with pytest.raises(BagError, match=rf"compressed its files as a whole; simbev repair {packed} unpacks them"):
        SceneBag(packed)
    repaired = repair_bag(packed, tmp_path / "repaired")
    assert not repaired.lost
    with SceneBag(bag) as original, SceneBag(repaired.path) as copy:
        assert {*copy.messages()} == {*original.messages()} and {*copy.attachments} == {*original.attachments}
    assert {path.name for path in tmp_path.iterdir()} == {"packed", "repaired"}


def test_a_bag_in_sqlite_form_is_refused_with_the_command_that_converts_it(bag: Path, tmp_path: Path) -> None:
    _convert(bag, tmp_path / "sqlite", "sqlite3")
    with pytest.raises(BagError, match=r"in SQLite form; rosbags-convert --src .* --dst-storage mcap converts it$"):
        SceneBag(tmp_path / "sqlite")


def test_a_converted_bag_is_replayed(bag: Path, tmp_path: Path) -> None:
    converted = _converted(bag, tmp_path / "Blocks-0000")
    with SceneBag(converted) as opened, SceneBag(bag) as original:
        chosen = build_recorded_roads(opened)
        scenario = parse_scenario(original.attachments[CONFIG_ATTACHMENT].decode(), "config.yaml")
        spec = replayed_spec(opened, scenario, load_network(chosen), chosen)
    replay = Replay(spec, converted)
    states = [replay.step() for _ in range(spec.warm_up_ticks + 1)]
    replay.close()
    assert states[-1].tick == 0 and len(states[-1].actors)
