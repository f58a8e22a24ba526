"""Bags that cannot be replayed, or not merged, are refused with one message before any process starts."""

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from replayable_scene import replayable_scene

from simbev_ros.production.replay import replays

pytestmark = pytest.mark.usefixtures("no_graph")

Refused = Callable[..., str]


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One scene of three ticks in which little moves, and a second one on other roads."""
    folder = tmp_path_factory.mktemp("dataset")
    replayable_scene(folder, 0)
    replayable_scene(folder, 1, roads="other roads")
    return folder


@pytest.fixture
def bag(dataset: Path, tmp_path: Path) -> Path:
    shutil.copytree(dataset, tmp_path / "dataset")
    return tmp_path / "dataset/scenes/train/Blocks-0000"


def test_a_bag_of_other_roads_is_refused(refused: Refused, bag: Path) -> None:
    error = refused("replay", bag, bag.with_name("Blocks-0001"), "demo")
    assert error == f"error: {bag.with_name('Blocks-0001')}: was recorded on other roads than map Blocks has now\n"


def test_a_missing_bag_is_refused(refused: Refused, tmp_path: Path) -> None:
    assert refused("replay", tmp_path / "nothing", "demo").endswith("nothing: no such file or folder\n")


def test_a_damaged_bag_is_refused(refused: Refused, bag: Path) -> None:
    file = bag / "Blocks-0000_0.mcap"
    data = bytearray(file.read_bytes())
    place = data.index(b"zstd") + 60
    data[place] ^= 1
    file.write_bytes(data)
    error = refused("replay", bag, "demo")
    assert error.startswith(f"error: {file}: damaged chunk at byte ") and error.count("\n") == 1


def test_two_bags_of_a_scene_do_not_fit_into_one_dataset(refused: Refused, bag: Path, tmp_path: Path) -> None:
    assert "Blocks-0000: two of the bags are of this scene" in refused(
        "replay", bag, bag, "demo", "--out", tmp_path / "x"
    )
    assert not (tmp_path / "x").exists()


@pytest.mark.parametrize("label", ["", "a.b", "x-0001", "partial", "replaced", "../up", "1st"])
def test_labels_that_could_be_mistaken_are_refused(refused: Refused, bag: Path, label: str) -> None:
    assert f"label {label!r}: allowed are a letter, then" in refused("replay", bag, "demo", "--merge", label)


def test_only_finished_scenes_of_a_dataset_get_additional_bags(refused: Refused, bag: Path, tmp_path: Path) -> None:
    outside = shutil.copytree(bag, tmp_path / "Blocks-0000")
    unfinished = shutil.copytree(bag, bag.with_name("Blocks-0002.partial"))
    for folder in (outside, unfinished):
        error = refused("replay", bag, folder, "demo", "--merge", "rear")
        assert f"{folder}: is not a finished scene of the dataset" in error
    bag.with_name("Blocks-0000.rear").mkdir()
    error = refused("replay", bag, "demo", "--merge", "rear")
    assert "Blocks-0000.rear: exists already; nothing was overwritten" in error
    assert "neither --out nor --live" in refused("replay", bag, "demo", "--merge", "rear", "--out", tmp_path / "x")
    assert sorted(each.name for each in bag.parents[2].iterdir()) == ["scenes"]


def test_of_a_dataset_only_what_is_not_recorded_yet_is_replayed(
    simbev: Callable[..., Any], refused: Refused, bag: Path, tmp_path: Path
) -> None:
    dataset, elsewhere = bag.parents[2], tmp_path / "x/scenes/train"
    for folder in (bag.with_name("Blocks-0001.rear"), elsewhere / "Blocks-0001"):
        folder.mkdir(parents=True)
    shutil.rmtree(bag)  # the other one could not be replayed: it is of other roads
    for place in (("--merge", "rear"), ("--out", tmp_path / "x")):
        answer = simbev("replay", dataset, "demo", *place)
        assert (answer.code, answer.out.strip()) == (0, "1 scene recorded before")
    assert "Blocks-0001: was recorded on other roads" in refused("replay", dataset, "demo", "--merge", "front")
    shutil.rmtree(dataset / "scenes/train/Blocks-0001")
    assert "there is no finished scene to replay" in refused("replay", dataset, "demo", "--out", tmp_path / "y")


@pytest.mark.parametrize("crew", [("--workers", 2), ("--ray", "auto")], ids=["workers", "ray"])
@pytest.mark.parametrize(
    "option", [("--live",), ("--evaluate", "figures.json"), ("--stack", "reference")], ids=lambda option: option[0]
)
def test_what_one_graph_does_is_refused_for_several(
    refused: Refused, bag: Path, tmp_path: Path, crew: tuple[object, ...], option: tuple[str, ...]
) -> None:
    error = refused("replay", bag, "demo", "--out", tmp_path / "x", *crew, *option)
    assert error == f"error: {option[0]}: is for one graph; give neither --workers nor --ray with it\n"
    assert not (tmp_path / "x").exists()


def test_several_graphs_have_to_record(refused: Refused, bag: Path) -> None:
    error = refused("replay", bag, "demo", "--workers", 2)
    assert error == "error: --workers and --ray record scenes; give --out or --merge with them\n"


@pytest.mark.parametrize("place", ["--out", "--merge"])
def test_workers_are_not_started_for_bags_that_cannot_be_replayed(
    refused: Refused, bag: Path, tmp_path: Path, place: str
) -> None:
    where = (place, tmp_path / "x" if place == "--out" else "rear")
    error = refused("replay", bag, bag.with_name("Blocks-0001"), "demo", *where, "--workers", 2)
    assert error == f"error: {bag.with_name('Blocks-0001')}: was recorded on other roads than map Blocks has now\n"
    assert not (tmp_path / "x").exists() and not (bag.parents[2] / ".making").exists()


def test_with_workers_nothing_is_played_that_is_recorded(simbev: Callable[..., Any], bag: Path) -> None:
    for name in ("Blocks-0000.rear", "Blocks-0001.rear"):
        bag.with_name(name).mkdir()
    answer = simbev("replay", bag.parents[2], "demo", "--merge", "rear", "--workers", 2)
    assert (answer.code, answer.out.strip()) == (0, "2 scenes recorded before")


def test_replays_of_workers_that_failed_are_listed_with_exit_code_1(
    simbev: Callable[..., Any], bag: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    result = replays.ReplayResult((tmp_path / "x/Blocks-0001",), (), {"Blocks-0000": "world died"})
    monkeypatch.setattr(replays, "replay_bags", lambda *_, **__: result)
    answer = simbev("replay", bag, "demo", "--out", tmp_path / "x", "--workers", 2)
    assert answer.code == 1 and f"recorded {tmp_path}/x/Blocks-0001\n" in answer.out
    assert "1 failed" in answer.out and "world died" in answer.out
