"""A dataset whose production is interrupted repeatedly ends with the same bytes as an uninterrupted one."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from commands import remove_leftovers
from generating import Simbev, files, generate, write
from ros_domain import DOMAIN

from simbev_ros.dataset.index import read_index
from simbev_ros.recording.layout import is_dataset, scenes_of
from simbev_ros.recording.verify import verify_bag
from simbev_ros.ros.graph.shared_memory import middleware_files

pytestmark = [pytest.mark.graph, pytest.mark.slow]


def test_killed_at_random_moments_it_ends_with_the_same_bytes(simbev: Simbev, tmp_path: Path) -> None:
    kills, scenes = 3, "{map: Blocks, train: 2}, {map: Town01, val: 2}"
    config, before = write(tmp_path, scenes), set(middleware_files())
    began_s = time.monotonic()
    generate(simbev, config, tmp_path / "undisturbed")
    undisturbed = files(tmp_path / "undisturbed")
    lasted_s = time.monotonic() - began_s
    moments = random.Random(kills)
    for _ in range(kills):
        command = simbev("generate", config, "--out", tmp_path / "killed")
        time.sleep(moments.uniform(0.2, 0.8) * lasted_s)
        os.killpg(command.process.pid, signal.SIGKILL)
        command.process.wait()
        assert files(tmp_path / "killed").items() <= undisturbed.items(), "existing scenes are complete"
    generate(simbev, config, tmp_path / "killed")
    assert files(tmp_path / "killed") == undisturbed
    assert sorted(path.name for path in (tmp_path / "killed").iterdir()) == [
        *(".lock", "index.parquet", "logs", "plan.json", "scenes")
    ]
    indexes = [read_index(tmp_path / name) for name in ("undisturbed", "killed")]
    assert indexes[0] == indexes[1] and len(indexes[0]) == len(undisturbed)
    assert not [fault for bag in scenes_of(tmp_path / "killed") for fault in verify_bag(bag)]
    remove_leftovers(before)


def test_scenes_are_added_and_replaced_without_touching_others(simbev: Simbev, tmp_path: Path) -> None:
    dataset = tmp_path / "set"
    generate(simbev, write(tmp_path, "{map: Blocks, train: 2, val: 1}"), dataset)
    first = files(dataset)
    config = write(tmp_path, "{map: Blocks, train: 3, val: 1}")
    assert "1 scene made" in generate(simbev, config, dataset)
    more = files(dataset)
    assert first.items() < more.items() and more.keys() - first.keys() == {
        "scenes/train/Blocks-0003/Blocks-0003_0.mcap"
    }
    assert "0 scenes made" in generate(simbev, config, dataset)
    config.write_text(config.read_text().replace("seed: 5", "seed: 6"))
    generate(simbev, config, dataset, "--replace", "0,2-3")
    replaced = files(dataset)
    assert replaced.keys() == more.keys()
    assert [name for name in more if replaced[name] == more[name]] == ["scenes/train/Blocks-0001/Blocks-0001_0.mcap"]
    assert [row["seed"] for row in read_index(dataset)] == [6, 6, 8, 9]


def test_an_interrupt_leaves_complete_scenes(simbev: Simbev, tmp_path: Path) -> None:
    config, dataset = write(tmp_path, "{map: Blocks, train: 60}", has_lidar=False), tmp_path / "set"
    command = simbev("generate", config, "--out", dataset)
    command.wait_for(lambda: is_dataset(dataset))
    assert not scenes_of(dataset), "the folder is a dataset before it has a scene"
    command.wait_for(lambda: len(files(dataset)) > 0)
    command.process.send_signal(signal.SIGINT)
    code, output = command.finish()
    assert code == 130, output
    assert not [fault for bag in scenes_of(dataset) for fault in verify_bag(bag)]
    assert not list(dataset.glob(".making"))


def test_a_scene_that_fails_is_listed_and_the_others_are_made(simbev: Simbev, tmp_path: Path) -> None:
    config, dataset = write(tmp_path, "{map: Blocks, train: 3}"), tmp_path / "set"
    entries = [{"number": number, "map": name, "split": "train"} for number, name in enumerate(["Blocks", "Atlantis"])]
    dataset.mkdir()
    (dataset / "plan.json").write_text(json.dumps({"scenes": [*entries, entries[0] | {"number": 2}]}))
    code, output = simbev("generate", config, "--out", dataset, "--replace", "0-2").finish()
    assert code == 1 and "2 scenes made" in output and "Atlantis-0001" in output
    assert "the configuration has no map Atlantis" in " ".join(output.split())
    assert [path.name for path in scenes_of(dataset)] == ["Blocks-0000", "Blocks-0002"]


PROGRAM = """
import sys
from simbev_ros.production import make_dataset
result = make_dataset(sys.argv[1], sys.argv[2])
assert [entry.name for entry in result.made] == ["Blocks-0000"] and result.is_complete, result
assert not {"rich.console", "typer", "simbev_ros.cli"} & sys.modules.keys()
"""


def test_a_python_program_makes_a_dataset_without_a_console(tmp_path: Path) -> None:
    config, dataset = write(tmp_path, "{map: Blocks, train: 1}"), tmp_path / "set"
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, config, dataset],
        env={**os.environ, "ROS_DOMAIN_ID": str(DOMAIN)},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=300,
        start_new_session=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert [row["name"] for row in read_index(dataset)] == ["Blocks-0000"]
    assert not [fault for bag in scenes_of(dataset) for fault in verify_bag(bag)]
