"""Repair saves every intact chunk byte for byte, names every loss, and leaves the old bag unchanged."""

import errno
import random
from pathlib import Path

import pytest
from damage import TICKS, intact_bag
from made_up_scene import made_up_scene
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from simbev_ros.cli.repair import repair
from simbev_ros.foundation.errors import BagError, DiskError, InputError
from simbev_ros.recording.mcap.mcap_index import read_mcap_index
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.recording.repair import repair_bag
from simbev_ros.recording.verify import verify_bag

MESSAGE_INDEX = bytes([Opcode.MESSAGE_INDEX])


def messages(path: Path) -> list[RawMessage]:
    with SceneBag(path) as bag:
        return list(bag.messages())


@pytest.fixture
def bag(tmp_path: Path) -> Path:
    return intact_bag(tmp_path / "a")


def chunk_ends(file: Path) -> list[tuple[int, int]]:
    """For each chunk its end in the file and the number of messages up to it."""
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None and len(summary.chunk_indexes) > 10
    ends, counted = [], 0
    with SceneBag(file) as bag:
        for chunk in summary.chunk_indexes:
            counted += len(bag._chunk_messages(0, chunk.chunk_start_offset, chunk.chunk_length))
            ends.append((chunk.chunk_start_offset + chunk.chunk_length, counted))
    return ends


def test_every_complete_chunk_of_a_cut_off_file_is_saved(bag: Path, tmp_path: Path) -> None:
    file = bag / "a_0.mcap"
    data, ends, original = file.read_bytes(), chunk_ends(file), messages(bag)
    with file.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    end = summary.metadata_indexes[-1].offset + summary.metadata_indexes[-1].length  # the summary adds nothing
    for number, size in enumerate(random.Random(1).sample(range(ends[0][0], end), 20)):
        file.write_bytes(data[:size])
        repaired = repair_bag(bag, tmp_path / f"saved{number}")
        whole = max(count for end, count in ends if end <= size)
        assert messages(repaired.path) == original[:whole]
        assert f"whatever would have followed byte {size:,}, where the file is cut off" in repaired.lost
        assert file.read_bytes() == data[:size]
        with AnyReader([repaired.path]) as reader:
            assert reader.message_count == whole


def test_a_flipped_bit_costs_at_most_its_chunk(bag: Path, tmp_path: Path) -> None:
    file = bag / "a_0.mcap"
    data, ends, original = file.read_bytes(), chunk_ends(file), messages(bag)
    sizes = [count - before for (_, count), before in zip(ends, [0, *(count for _, count in ends)], strict=False)]
    choice = random.Random(3)
    for number in range(25):
        offset = choice.randrange(8, ends[-1][0])
        damaged = bytearray(data)
        damaged[offset] ^= 1 << choice.randrange(8)
        file.write_bytes(damaged)
        repaired = repair_bag(bag, tmp_path / f"saved{number}")
        saved = messages(repaired.path)
        assert set(saved) <= set(original)
        assert len(saved) >= len(original) - max(sizes)
        if len(saved) < len(original):
            assert repaired.lost


def test_a_bag_without_indexes_or_record_headers_is_restored_completely(bag: Path, tmp_path: Path) -> None:
    file = bag / "a_0.mcap"
    data, ends, original = file.read_bytes(), chunk_ends(file), messages(bag)
    starts = [data.index(MESSAGE_INDEX, end) for end, _ in ends]
    heads = [
        *starts,
        *(offset + 1 for offset in starts),
        *(offset + 11 for offset in starts),
        ends[4][1],
        len(data) - 400,
    ]
    for number, offset in enumerate(heads):
        damaged = bytearray(data)
        damaged[offset] ^= 8
        file.write_bytes(damaged)
        repaired = repair_bag(bag, tmp_path / f"saved{number}")
        assert messages(repaired.path) == original and repaired.lost == [] and verify_bag(repaired.path) == []


def test_a_chunk_that_looks_like_the_end_of_the_file_is_the_only_loss(bag: Path, tmp_path: Path) -> None:
    file = bag / "a_0.mcap"
    with file.open("rb") as stream:
        starts = [chunk.offset for chunk in read_mcap_index(stream, "").chunks]
    data, original = file.read_bytes(), messages(bag)
    for number, opcode in enumerate((Opcode.FOOTER, Opcode.DATA_END)):
        damaged = bytearray(data)
        damaged[starts[5]], damaged[-50] = opcode, damaged[-50] ^ 1  # with an intact summary nothing would be lost
        file.write_bytes(damaged)
        repaired = repair_bag(bag, tmp_path / f"saved{number}")
        assert 0 < len(original) - len(messages(repaired.path)) < 6 and repaired.lost


def test_a_half_indexed_file_loses_nothing(bag: Path, tmp_path: Path) -> None:
    file = bag / "a_0.mcap"
    original = messages(bag)
    data = file.read_bytes()
    file.write_bytes(data[: chunk_ends(file)[-1][0] + 40] + bytes(100))
    repaired = repair_bag(file, tmp_path / "saved")
    assert messages(repaired.path) == original and repaired.counts == {"/cam/image_raw": TICKS, "/world/weather": TICKS}
    (fault,) = verify_bag(
        repaired.path
    )  # the accounts are in metadata.yaml, but the contents of the lost end are unknown
    assert fault.problem.startswith("the scene is incomplete")


def test_an_intact_bag_stays_complete(bag: Path, tmp_path: Path) -> None:
    repaired = repair_bag(bag, tmp_path / "saved")
    assert repaired.lost == [] and verify_bag(repaired.path) == [] and messages(repaired.path) == messages(bag)
    with SceneBag(repaired.path) as new, SceneBag(bag) as old:
        assert new.attachments == old.attachments
        assert [topic.type_hash for topic in new.topics.values()] == [topic.type_hash for topic in old.topics.values()]


def test_nothing_is_overwritten_and_an_empty_bag_is_refused(bag: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="exists already"):
        repair_bag(bag, bag)
    for content in (b"", b"x" * 5000):
        file = tmp_path / "bad.mcap"
        file.write_bytes(content)
        with pytest.raises(BagError, match="no message"):
            repair_bag(file, tmp_path / "saved")


def test_topics_of_unknown_types_are_named_and_the_others_saved(tmp_path: Path) -> None:
    with (tmp_path / "foreign.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic, kind in (("/own", "my_msgs/msg/Own"), ("/none", ""), ("/words", "std_msgs/msg/String")):
            schema = writer.register_schema(kind, "ros2msg", b"string data") if kind else 0
            channel = writer.register_channel(topic, "cdr", schema)
            writer.add_message(channel, 1, b"\0\1\0\0\2\0\0\0a\0", 1)
        writer.finish()
    repaired = repair_bag(tmp_path / "foreign.mcap", tmp_path / "saved")
    assert repaired.counts == {"/words": 1}
    assert repaired.lost == [f"/{name}: 1 messages of an unknown type" for name in ("own", "none")]


def test_typed_messages_are_saved_with_their_definitions(tmp_path: Path) -> None:
    made_up_scene(tmp_path / "a", typed=True)
    repaired = repair_bag(tmp_path / "a", tmp_path / "b")
    assert repaired.lost == [] and repaired.counts["/ego/boxes/typed"] == 3
    with SceneBag(tmp_path / "a") as before, SceneBag(tmp_path / "b") as after:
        assert list(before.messages()) == list(after.messages())
        schemas = [{schema.name: schema.data for _, schema in bag.definitions()} for bag in (before, after)]
    assert (
        schemas[0] == schemas[1] and b"# m, map frame: center of the box" in schemas[0]["simbev_interfaces/msg/Boxes"]
    )


def test_a_full_disk_leaves_no_partial_bag(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("simbev_ros.recording.mcap.mcap_file.McapFile.add_chunk", full)
    with pytest.raises(DiskError, match=r"saved\.partial: the disk is full; nothing of the new bag is left$"):
        repair_bag(bag, tmp_path / "saved")
    assert sorted(path.name for path in tmp_path.iterdir()) == [bag.name]


def test_an_interrupt_leaves_no_partial_bag(bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simbev_ros.recording.repair._missing_messages", lambda *_: pytest.fail("interrupted"))
    with pytest.raises(pytest.fail.Exception, match="interrupted"):
        repair_bag(bag, tmp_path / "saved")
    assert sorted(path.name for path in tmp_path.iterdir()) == [bag.name]


def test_the_command_works_within_the_folder_and_without_its_first_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = intact_bag(tmp_path / "a", split_bytes=2000)
    monkeypatch.chdir(bag)
    repair(Path())
    assert messages(tmp_path / "a-repaired") == messages(bag)
    (bag / "a_0.mcap").unlink()
    repair(bag, tmp_path / "b")
    assert "lost: file 0, which is missing" in capsys.readouterr().out
