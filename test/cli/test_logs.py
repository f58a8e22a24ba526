"""Logs of scenes on the console: failed attempts first; what has no log is refused in one line."""

import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from simbev_ros.production.scene_log import Attempt, write_scene_log

Simbev = Callable[..., Any]
Refused = Callable[..., str]


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of two planned scenes, of which the second was made at the eleventh attempt."""
    dataset = tmp_path / "set"
    (dataset / "scenes").mkdir(parents=True)
    entries = [{"number": number, "map": "Blocks", "split": "train"} for number in (0, 17)]
    (dataset / "plan.json").write_text(json.dumps({"scenes": entries}))
    for number in (10, 2, 1):
        attempt = Attempt("Blocks-0017", number, "worker-1, this machine")
        write_scene_log(dataset, attempt, f"problem {number}", {"world": "[red] line\n"}, failed=True)
    write_scene_log(dataset, Attempt("Blocks-0017", 11, ""), "duration after tick 9", {})
    return dataset


def test_failed_attempts_come_first_in_their_order_each_with_a_heading(simbev: Simbev, dataset: Path) -> None:
    answer = simbev("logs", dataset, 17)
    lines = answer.out.splitlines()
    assert (answer.code, answer.err) == (0, "")
    headings = [line.rstrip("─ ") for line in lines if line.endswith("──")]
    assert headings == [*(f"Blocks-0017.failed-{number}.log" for number in (1, 2, 10)), "Blocks-0017.log"]
    attempts = [line.partition(" on ")[0].partition(",")[2][:12] for line in lines if ", attempt " in line]
    assert attempts == [" attempt 1", " attempt 2", " attempt 10", " attempt 11,"]
    assert lines[1].startswith("Blocks-0017, attempt 1 on worker-1, this machine, began ")
    assert lines[2:5] == ["problem 1", "--- world", "[red] line"] and lines[-1] == "duration after tick 9"


def test_logs_of_additional_bags_follow_those_of_the_scene(simbev: Simbev, dataset: Path) -> None:
    write_scene_log(dataset, Attempt("Blocks-0017.rear", 2, ""), "made", {})
    write_scene_log(dataset, Attempt("Blocks-0017.rear", 1, ""), "problem", {}, failed=True)
    write_scene_log(dataset, Attempt("Blocks-00170", 1, ""), "another scene", {})
    headings = [line.rstrip("─ ") for line in simbev("logs", dataset, 17).out.splitlines() if line.endswith("──")]
    assert headings[3:] == ["Blocks-0017.log", "Blocks-0017.rear.failed-1.log", "Blocks-0017.rear.log"]


def test_control_characters_in_a_log_do_not_reach_the_terminal(simbev: Simbev, dataset: Path) -> None:
    (dataset / "logs/Blocks-0017.log").write_bytes(b"\x1b]0;title\x07 \xff\n")
    answer = simbev("logs", dataset, "0017")
    assert answer.code == 0 and not {"\x1b", "\x07"} & set(answer.out) and "title" in answer.out


@pytest.mark.parametrize("number", ["18", "-1", "x", "", "1.0", "٣", "9" * 5000, "[/no]"])
def test_a_number_without_a_scene_is_refused_in_one_line(refused: Refused, dataset: Path, number: str) -> None:
    message = refused("logs", "--", dataset, number)
    assert message == f"error: NUMBER: {dataset} has no scene {number!r:.80}; allowed: 0 to 17\n"


def test_a_scene_without_a_log_is_refused_in_one_line(refused: Refused, dataset: Path) -> None:
    message = f"error: {dataset}: scene Blocks-0000 has no log yet; generate writes one for each attempt\n"
    assert refused("logs", dataset, 0) == message


def test_without_a_dataset_or_scenes_there_are_no_logs(refused: Refused, dataset: Path, tmp_path: Path) -> None:
    assert refused("logs", tmp_path / "no", 0) == f"error: {tmp_path / 'no'}: no such file or folder\n"
    assert refused("logs", tmp_path, 0) == f"error: {tmp_path}: is not a dataset\n"
    (dataset / "plan.json").unlink()
    message = f"error: NUMBER: {dataset} has no scene '0'; allowed: none, as the dataset has no scenes\n"
    assert refused("logs", dataset, 0) == message


@pytest.mark.parametrize("name", ["Blocks-0017.log", "Blocks-0017.failed-2.log"])
def test_a_log_that_is_a_link_out_or_no_file_is_refused(refused: Refused, dataset: Path, name: str) -> None:
    log = dataset / "logs" / name
    log.unlink()
    (dataset.parent / "secret").write_text("secret")
    log.symlink_to(dataset.parent / "secret")
    assert "leads out of" in refused("logs", dataset, 17)
    log.unlink()
    os.mkfifo(log)
    if "failed" in name:
        assert refused("logs", dataset, 17) == f"error: {log}: is not a file\n"
