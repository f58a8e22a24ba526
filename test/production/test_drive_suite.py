"""The table of the suite of drives, and the tables of its scores."""

from collections import Counter
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import pytest

from simbev_ros.evaluation.driving.recorded_drives import RecordedDrive
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.drive_suite import (
    GROUPS,
    SuiteDrive,
    make_suite,
    suite_figures,
    suite_scenarios,
    suite_size,
    suite_tables,
)
from simbev_ros.scene.drawing.draw_events import missing_events

ABILITIES = ("merging", "overtaking", "emergency_brake", "give_way", "traffic_sign")


def names(routes: int) -> list[tuple[str, str]]:
    scenarios = suite_scenarios("drive-truth", "ackermann", routes)
    return [
        (ability, f"{entry.map}-{number:04d}")
        for ability, scenario in scenarios.items()
        for number, entry in enumerate(scenario.scenes)
    ]


def test_the_suite_has_44_scenes_of_each_ability_on_all_towns_with_unique_names() -> None:
    found = names(suite_size())
    assert Counter(ability for ability, _ in found) == dict.fromkeys(ABILITIES, 44)
    assert len({name for _, name in found}) == 220
    counts = Counter(name.rpartition("-")[0] for _, name in found)
    assert {*counts} == {Path(each.name).stem for each in files("simbev_ros.maps").joinpath("towns").iterdir()}
    assert max(counts.values()) - min(counts.values()) <= 4


def test_fewer_routes_are_the_first_ones_of_each_ability() -> None:
    few = names(22)
    assert Counter(ability for ability, _ in few) == {**dict.fromkeys(ABILITIES, 4), "merging": 5, "overtaking": 5}
    assert {*few} <= {*names(220)}


@pytest.mark.parametrize(
    ("stack", "driver", "command"),
    [
        ("drive-learned", "path", ("drive-learned",)),
        ("python3 mine.py --fast", "ackermann", ("python3", "mine.py", "--fast")),
        ("traffic", "traffic", None),
        ("none", "twist", None),
    ],
)
def test_the_stack_says_who_drives(stack: str, driver: str, command: tuple[str, ...] | None) -> None:
    scenario = suite_scenarios(stack, "ackermann", 1)["merging"]
    assert scenario.ego.driver == driver
    assert scenario.drive is not None
    assert scenario.drive.stack == command


def test_an_empty_command_is_refused() -> None:
    with pytest.raises(InputError, match="the command is empty"):
        suite_scenarios("", "ackermann", 1)


def test_drives_of_another_driver_are_not_mixed_with_those_that_exist(
    tmp_path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("simbev_ros.production.drive_suite.changed_sections", lambda *_: ["drive"])
    with pytest.raises(InputError, match=r"merging: has drives with other settings \(drive\); use a new folder"):
        make_suite(suite_scenarios("none", "path", 1), tmp_path)


def test_each_ability_reports_its_own_progress(tmp_path, monkeypatch: pytest.MonkeyPatch) -> None:
    told = {}
    monkeypatch.setattr("simbev_ros.production.drive_suite.changed_sections", lambda *_: [])
    monkeypatch.setattr(
        "simbev_ros.production.drive_suite.make_dataset", lambda _, out, **options: told.update({out.name: options})
    )
    observers = {ability: object() for ability in ("merging", "overtaking")}
    make_suite(suite_scenarios("none", "path", 2), tmp_path, observers=observers)
    assert {ability: options["observer"] for ability, options in told.items()} == observers


def made_up(name: str, score: float, *groups: str) -> SuiteDrive:
    scores = {
        "leaderboard_2_0": {"driving_score": score, "route_completion": 100.0},
        "leaderboard_2_1": {"driving_score": score},
        "bench2drive": {"driving_score": score, "success": 1.0, "efficiency": None, "comfortness": 50.0},
        "nuplan": {"score": score / 100.0},
    }
    figures = {"ended": "goal", "completed": 1.0, "infractions": {"red_light": 1}, "scores": scores}
    return SuiteDrive(
        SimpleNamespace(name=name), RecordedDrive(name, figures, ()), dict(zip(GROUPS, groups, strict=True))
    )


def test_scores_are_averaged_by_group() -> None:
    drives = [
        made_up("Town02-0000", 80.0, "merging", "Town02", "rain", "day"),
        made_up("Town01-0001", 40.0, "merging", "Town01", "clear", "day"),
        made_up("Town02-0002", 60.0, "give_way", "Town02", "clear", "day"),
    ]
    figures = suite_figures(drives, "mine")
    assert (figures["stack"], figures["drives"], figures["infractions"]) == ("mine", 3, {"red_light": 3})
    tables = {table.heads[0]: table for table in suite_tables(figures)}
    scores = {head: [(row[0].value, row[2].value) for row in table.rows] for head, table in tables.items()}
    assert scores["ability"] == [("merging (2)", 60.0), ("give_way (1)", 60.0), ("mean", 60.0)]
    assert scores["town"] == [("Town01 (1)", 40.0), ("Town02 (2)", 70.0), ("mean", 60.0)]
    assert scores["weather"] == [("rain (1)", 80.0), ("clear (2)", 50.0), ("mean", 60.0)]
    assert scores["daytime"] == [("day (3)", 60.0)]


@pytest.mark.parametrize(
    ("required", "wanted"), [(True, ["drive.events.required: room for 0 of 1 events"]), (False, [])]
)
def test_a_scene_without_room_for_its_event_is_drawn_again(required: bool, wanted: list[str]) -> None:
    scenario = suite_scenarios("none", "ackermann", 60)["merging"]
    blocks = scenario.model_copy(update={"scenes": scenario.scenes[-1:]})
    [spec] = draw_scenes(blocks)
    assert spec.drive is not None and scenario.drive is not None and scenario.drive.events is not None
    assert [each.kind.value in ("cut_in", "merge") for each in spec.drive.events] == [True]
    events = scenario.drive.events.model_copy(update={"required": required})
    scenario = scenario.model_copy(update={"drive": scenario.drive.model_copy(update={"events": events})})
    bare = spec.model_copy(update={"drive": spec.drive.model_copy(update={"events": ()})})
    assert [each.removesuffix(" on the route") for each in missing_events(scenario, bare)] == wanted
    assert not [*missing_events(scenario, spec)]


def test_the_learned_driver_has_a_slower_lidar_and_drives_the_same_scenes() -> None:
    (learned, truth) = (suite_scenarios(stack, "path", 5) for stack in ("drive-learned", "drive-truth"))
    for ability, scenario in learned.items():
        lidars = [each.rig.sensors[0] for each in (scenario, truth[ability])]
        assert [each.rate_hz for each in lidars] == [4.0, 10.0]
        assert scenario.rig.sensors[1:] == truth[ability].rig.sensors[1:]
        same = {"rig": None, "drive": None}
        assert scenario.model_copy(update=same) == truth[ability].model_copy(update=same)
