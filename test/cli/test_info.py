import json
from pathlib import Path

import pytest
from ros_messages import string

from simbev_ros.cli.info import info
from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.recording.accounting import Accounting, Schedule
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.qos import QosProfile
from simbev_ros.recording.reader import SceneBag

TICK_NS = 50_000_000


def write_words(path: Path, *, ticks: int = 5, missing: int | None = None, finish: bool = True, **more: str) -> Path:
    books = Accounting({"/words": Schedule()}, start_ns=0, tick_ns=TICK_NS, ticks=ticks)
    with SceneBagWriter(path) as writer:
        writer.add_topic("/words", "std_msgs/msg/String", QosProfile())
        for tick in range(ticks):
            if tick != missing:
                books.add_message("/words", tick * TICK_NS)
                writer.write("/words", tick * TICK_NS, string(f"word {tick}"))
        facts = books.report().custom_data(path.name) | more
        return writer.finish(facts) if finish else writer.abandon(facts)


def test_json_tells_counts_rates_sizes_and_completeness(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    info(write_words(tmp_path / "a"), as_json=True)
    facts = json.loads(capsys.readouterr().out)
    assert (facts["name"], facts["state"], facts["complete"], facts["messages"]) == ("a", "finished", True, 5)
    assert facts["duration_s"] == pytest.approx(0.2)
    (topic,) = facts["topics"]
    assert topic == {
        "name": "/words",
        "type": "std_msgs/msg/String",
        "count": 5,
        "expected": 5,
        "rate_hz": pytest.approx(20.0),
        "bytes": 5 * len(string("word 0")),
    }


def test_table_shows_topic_digest_and_what_is_missing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_words(tmp_path / "a", missing=3)
    info(path, digest=True)
    text = capsys.readouterr().out
    with SceneBag(path) as bag:
        assert topic_digests(bag)["/words"][:16] in text
    assert "4 of 5" in text
    assert "/words: 4 of 5 messages, missing at ticks 3" in text
    assert "finished, incomplete" in text


def test_a_scene_that_ended_early_is_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    info(write_words(tmp_path / "a", ended="ego stood still for 8 s at tick 4"))
    text = capsys.readouterr().out
    assert "finished, complete, ended early" in text and "ego stood still for 8 s at tick 4" in text
    info(write_words(tmp_path / "b", ended="duration"))
    assert "early" not in capsys.readouterr().out


def test_unfinished_and_cut_off_bags_are_called_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = write_words(tmp_path / "a", finish=False)
    info(path, as_json=True)
    assert json.loads(capsys.readouterr().out)["state"] == "unfinished"
    mcap = path / "a_0.mcap"
    mcap.write_bytes(mcap.read_bytes()[:-20])
    info(path, as_json=True)
    facts = json.loads(capsys.readouterr().out)
    assert (facts["state"], facts["messages"]) == ("cut off", 5)


def test_a_dataset_is_listed_by_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_words(tmp_path / "scenes" / "train" / "Town01-0000")
    write_words(tmp_path / "scenes" / "val" / "Town02-0001", finish=False)
    info(tmp_path)
    text = capsys.readouterr().out
    assert "1 of 2 scenes finished" in text
    assert "train/Town01-0000" in text and "val/Town02-0001" in text and "unfinished" in text


def test_planned_scenes_that_are_not_made_yet_count(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_words(tmp_path / "scenes" / "train" / "Town01-0000")
    entries = [PlannedEntry(number=number, map="Town01", split="train") for number in range(3)]
    Plan().with_entries(entries).save(tmp_path)
    info(tmp_path)
    assert "1 of 3 scenes finished" in capsys.readouterr().out
    info(tmp_path, as_json=True)
    assert json.loads(capsys.readouterr().out)["missing"] == ["Town01-0001", "Town01-0002"]


def test_an_attached_scene_of_another_version_is_a_bag_error(tmp_path: Path) -> None:
    with SceneBagWriter(tmp_path / "a") as writer:
        writer.add_attachment("scene.json", "application/json", b'{"number": -1}')
        path = writer.finish({})
    with pytest.raises(BagError, match=r"a: scene\.json: number: Input should be greater"):
        info(path)


def test_a_damaged_bag_hides_no_other_of_the_dataset(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_words(tmp_path / "scenes/train/Town01-0000")
    damaged = write_words(tmp_path / "scenes/train/Town01-0001")
    (damaged / "Town01-0001_0.mcap").write_bytes(b"")
    info(tmp_path)
    text = capsys.readouterr().out
    assert "1 of 2 scenes finished" in text and "train/Town01-0000" in text
    assert "damaged: " in text and "Town01-0001_0.mcap: not an MCAP file" in text
    info(tmp_path, as_json=True)
    assert [scene["state"] for scene in json.loads(capsys.readouterr().out)["scenes"]] == ["finished", "damaged"]


@pytest.mark.parametrize(
    ("report", "problem"),
    [
        ("none/a.html", "there is no folder"),
        ("folder.html", "is a folder"),
        ("file", "is a file; allowed: a folder"),
        ("..", "must end in"),
        ("taken", "taken/index_files: is a file; the pages need a folder"),
        ("page.html", "page_files: is a link to folder.html"),
        ("linked", "linked/index_files/scenes: is a link to "),
    ],
)
def test_a_report_that_cannot_be_written_is_refused_at_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], report: str, problem: str
) -> None:
    (tmp_path / "folder.html").mkdir()
    (tmp_path / "file").touch()
    (tmp_path / "taken").mkdir()
    (tmp_path / "taken/index_files").touch()
    (tmp_path / "page_files").symlink_to("folder.html")
    (tmp_path / "linked/index_files").mkdir(parents=True)
    (tmp_path / "linked/index_files/scenes").symlink_to(tmp_path)
    with pytest.raises(InputError, match=problem):
        info(write_words(tmp_path / "a"), report=tmp_path / report)
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize("report", ["s3://bucket/page", "s3://bucket/page.html", "https://host/page"])
def test_a_report_is_not_written_to_a_url(tmp_path: Path, report: str) -> None:
    with pytest.raises(InputError, match="must be a path on this machine, not a URL with"):
        info(write_words(tmp_path / "a"), report=Path(report))


def test_names_in_a_bag_are_printed_as_they_are_and_cannot_control_the_terminal(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with SceneBagWriter(tmp_path / "[red]a") as writer:
        writer.add_attachment("[/nope]", "text/plain", b"")
        writer.add_topic("/[bold]words\x1b[2J", "std_msgs/msg/String", QosProfile())
        writer.write("/[bold]words\x1b[2J", 0, string("word"))
        path = writer.finish({"ended": "[/]", "problems": '["[/x]"]'})
    info(path)
    text = capsys.readouterr().out
    assert "\x1b[2J" not in text
    for shown in ("[red]a", "[/nope] (0 bytes)", r"/[bold]words\x1b[2J", "ended     [/]", "[/x]"):
        assert shown in text
