"""The plan keeps assigned numbers, counts existing scenes, and lists exactly the missing ones."""

import os
from pathlib import Path

import pytest

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.lock import DatasetLock
from simbev_ros.dataset.plan import Plan, bag_of
from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.drawing.chosen_maps import maps_of
from simbev_ros.scene.drawing.draw_scene import planned_scenes
from simbev_ros.schema.scene.map_spec import MapSpec


def scenario_with(*scenes: dict[str, object]) -> Scenario:
    return Scenario.model_validate({"scenes": scenes, "rig": {"sensors": []}})


def with_maps(scenario: Scenario) -> tuple[Scenario, list[MapSpec]]:
    return scenario, maps_of(scenario)


BLOCKS, TOWN = {"map": "Blocks", "train": 3, "val": 1}, {"map": "Town01", "train": 2, "test": 1}


def test_a_new_dataset_has_the_scenes_of_simbev_run(tmp_path: Path) -> None:
    scenario = scenario_with(BLOCKS, TOWN)
    plan = Plan.load(tmp_path).with_scenes_of(*with_maps(scenario))
    expected = [(scene.number, scene.map.name, scene.split) for scene in planned_scenes(scenario)]
    assert [(entry.number, entry.map, entry.split) for entry in plan.scenes] == expected
    assert plan.missing_entries(tmp_path, *with_maps(scenario)) == list(plan.scenes)


def test_scenes_added_later_are_numbered_last_and_nothing_is_renumbered(tmp_path: Path) -> None:
    first = Plan.load(tmp_path).with_scenes_of(*with_maps(scenario_with(BLOCKS, TOWN)))
    first.save(tmp_path)
    bag_of(tmp_path, first.scenes[1]).mkdir(parents=True)
    more = scenario_with(BLOCKS | {"train": 5}, TOWN)
    plan = Plan.load(tmp_path).with_scenes_of(*with_maps(more))
    assert plan.scenes[: len(first.scenes)] == first.scenes
    assert [entry.name for entry in plan.scenes[len(first.scenes) :]] == ["Blocks-0007", "Blocks-0008"]
    assert [entry.number for entry in plan.missing_entries(tmp_path, *with_maps(more))] == [0, 2, 3, 4, 5, 6, 7, 8]


def test_fewer_requested_scenes_are_fewer_missing_scenes(tmp_path: Path) -> None:
    plan = Plan.load(tmp_path).with_scenes_of(*with_maps(scenario_with(BLOCKS | {"train": 9})))
    for number in (4, 5):
        bag_of(tmp_path, plan.scenes[number]).mkdir(parents=True)
    less = with_maps(scenario_with(BLOCKS))
    assert [entry.number for entry in plan.with_scenes_of(*less).missing_entries(tmp_path, *less)] == [0, 9]


def test_bags_without_a_plan_are_added_to_it(tmp_path: Path) -> None:
    for name in ("train/Blocks-0000", "train/Blocks-0006", "val/my-town-0003", "train/Blocks-0001.partial"):
        (tmp_path / "scenes" / name).mkdir(parents=True)
    plan = Plan.load(tmp_path).with_scenes_of(*with_maps(scenario_with(BLOCKS)))
    names = [(entry.name, entry.split) for entry in plan.scenes]
    assert names[:3] == [("Blocks-0000", "train"), ("my-town-0003", "val"), ("Blocks-0006", "train")]
    assert names[3:] == [("Blocks-0007", "train"), ("Blocks-0008", "val")]


def test_a_damaged_plan_is_named(tmp_path: Path) -> None:
    (tmp_path / "plan.json").write_text('{"scenes": [{"number": 1}]}')
    with pytest.raises(InputError, match=r"plan\.json: "):
        Plan.load(tmp_path)
    (tmp_path / "plan.json").unlink()
    (tmp_path / "plan.json").mkdir()
    with pytest.raises(InputError, match=r"plan\.json: is not a file"):
        Plan.load(tmp_path)


def test_a_scene_that_does_not_exist_cannot_be_replaced(tmp_path: Path) -> None:
    plan = Plan.load(tmp_path).with_scenes_of(*with_maps(scenario_with(BLOCKS)))
    assert [entry.number for entry in plan.entries_with_numbers([range(2, 3), range(1, 3)])] == [1, 2]
    with pytest.raises(InputError, match=r"^replace: the dataset has no scene 7, 9; its numbers are 0 to 3"):
        plan.entries_with_numbers([range(1, 2), range(7, 8), range(9, 10)])
    with pytest.raises(InputError, match="no scene 4, 5, 6, 7, 8;"):
        plan.entries_with_numbers([range(3_000_000_000_001)])
    with pytest.raises(InputError, match="no scene 0; it has none"):
        Plan().entries_with_numbers([range(1)])


def test_a_dataset_has_one_writer(tmp_path: Path) -> None:
    with DatasetLock(tmp_path / "set"), pytest.raises(InputError, match=r"process \d+ is writing into it"):
        DatasetLock(tmp_path / "set")
    with DatasetLock(tmp_path / "set"):
        pass


def test_folders_that_are_no_scenes_of_ours_are_not_planned(tmp_path: Path) -> None:
    for name in ("Blocks-0003", "a b-0004", "..-0005", "Blocks"):
        (tmp_path / "scenes/train" / name).mkdir(parents=True)
    assert [entry.name for entry in Plan.load(tmp_path).scenes] == ["Blocks-0003"]


def test_a_lock_file_that_is_a_link_or_no_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    (tmp_path / "set").mkdir()
    lock = tmp_path / "set/.lock"
    lock.symlink_to(tmp_path / "precious")
    with pytest.raises(InputError, match=r"set: cannot be written to: \.lock is a link"):
        DatasetLock(tmp_path / "set")
    assert (tmp_path / "precious").read_text() == "mine"
    lock.unlink()
    lock.hardlink_to(tmp_path / "precious")
    with pytest.raises(InputError, match=r"set: \.lock has other content than a lock; remove it"):
        DatasetLock(tmp_path / "set")
    assert (tmp_path / "precious").read_text() == "mine"
    lock.unlink()
    lock.write_text("4711")  # of a process that was killed
    with DatasetLock(tmp_path / "set"):
        assert lock.read_text() == str(os.getpid())
    lock.unlink()
    os.mkfifo(lock)
    with pytest.raises(InputError, match=r"set: cannot be written to: \.lock is not a file"):
        DatasetLock(tmp_path / "set")
