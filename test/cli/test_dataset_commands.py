"""Messages of generate, its dry run and verify about incomplete or damaged datasets; no graph is started."""

import json
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import made_up_scene

from simbev_ros.dataset.index import read_index
from simbev_ros.recording.layout import scenes_of

Simbev = Callable[..., Any]


@pytest.fixture
def config(tmp_path: Path) -> Path:
    path = tmp_path / "my.yaml"
    path.write_text("scenes: [{map: Blocks, train: 2}]\nrig: {sensors: []}\n")
    return path


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """Two scenes without a plan and an index."""
    for number in range(2):
        made_up_scene(tmp_path / f"set/scenes/train/Blocks-000{number}", number=number, ticks=2)
    return tmp_path / "set"


def test_where_nothing_is_missing_the_index_still_is_made(simbev: Simbev, config: Path, dataset: Path) -> None:
    answer = simbev("generate", config, "--out", dataset)
    assert answer.code == 0 and "0 scenes made" in answer.out
    assert [row["name"] for row in read_index(dataset)] == ["Blocks-0000", "Blocks-0001"]


@pytest.mark.parametrize("damage", ["cut off", "empty", "gone"])
def test_a_damaged_scene_is_listed_with_what_to_do(simbev: Simbev, config: Path, dataset: Path, damage: str) -> None:
    mcap = dataset / "scenes/train/Blocks-0001/Blocks-0001_0.mcap"
    content = mcap.read_bytes()
    mcap.unlink()
    if damage != "gone":
        mcap.write_bytes(content[:-100] if damage == "cut off" else b"")
    answer = simbev("generate", config, "--out", dataset)
    assert answer.code == 1 and "Blocks-0001" in answer.out
    assert "--replace 1 makes it again" in " ".join(answer.out.split())
    assert [row["name"] for row in read_index(dataset)] == ["Blocks-0000"]


def test_bad_input_leaves_no_dataset_behind(refused: Callable[..., str], config: Path, tmp_path: Path) -> None:
    config.write_text("scenes: [{map: Town99, train: 2}]\nrig: {sensors: []}\n")
    assert "no map is called 'Town99'" in refused("generate", config, "--out", tmp_path / "new")
    assert not (tmp_path / "new").exists()


def test_a_dry_run_counts_bags_not_rows_of_the_index(simbev: Simbev, config: Path, dataset: Path) -> None:
    answer = simbev("generate", config, "--out", dataset, "--dry-run")
    assert answer.code == 0 and "nothing is missing" in answer.out
    assert answer.out.split("Blocks")[1].split("│")[1].strip() == "2"
    assert not (dataset / "plan.json").exists()


def test_verify_names_every_bag_and_fault_in_full(
    simbev: Simbev, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simbev_ros.cli.verify._MAX_SHOWN", 1)
    for bag in scenes_of(dataset):
        (bag / "metadata.yaml").unlink()
    faults = json.loads(simbev("verify", dataset, "--json").out)["faults"]
    answer = simbev("verify", dataset)
    shown = "".join(line.split("│")[1].strip() for line in answer.out.splitlines() if "│" in line)
    assert answer.code == 1 and str(faults[0]["bag"]) in shown
    assert f"and {len(faults) - 1} more" in answer.out and f"{len(faults)} faults in 2 bags" in answer.out


def test_ctrl_c_while_the_command_is_being_started_shows_no_traceback() -> None:
    program = "import os, signal, sys; sys.argv[0] = '-m'; import simbev_ros.cli; os.kill(os.getpid(), signal.SIGINT)"
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (-signal.SIGINT, "")
