"""Scores of drives against hand-computed values and against results that CARLA's own evaluation has published."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from simbev_ros.evaluation.driving.drive_record import DriveRecord
from simbev_ros.evaluation.driving.figures import SCORES, checked_figures, drive_figures, drives_figures, mean_figures
from simbev_ros.evaluation.driving.infractions import UNITS, Infraction, InfractionKind
from simbev_ros.evaluation.driving.motion import comfort_variables, is_comfortable
from simbev_ros.evaluation.driving.rules.pace import SpeedSums
from simbev_ros.evaluation.driving.scores.bench2drive import bench2drive
from simbev_ros.evaluation.driving.scores.leaderboard import leaderboard_2_0, leaderboard_2_1
from simbev_ros.evaluation.driving.scores.nuplan import nuplan
from simbev_ros.evaluation.driving.tables import score_table

K = InfractionKind
PERFECT = DriveRecord(
    infractions=(),
    completed=1.0,
    ended="goal",
    tick_s=0.05,
    ticks=800,
    driven_m=400.0,
    outside_m=0.0,
    overspeed_m=0.0,
    max_off_road_m=0.0,
    max_oncoming_m=0.0,
    min_time_to_collision_s=np.inf,
    speed_checks=(SpeedSums(0.0, 0.0), SpeedSums(90.0, 100.0), SpeedSums(200.0, 200.0)),
    comfort=comfort_variables(np.zeros((800, 5)), 0.05),
)


def did(*done: tuple[K, float] | K, **changes: object) -> DriveRecord:
    """A drive with infractions at 5 m/s, some with a value."""
    pairs = [each if isinstance(each, tuple) else (each, 0.0) for each in done]
    made = tuple(Infraction(kind, 1, 0, (0.0, 0.0, 0.0), 5.0, value=value) for kind, value in pairs)
    return replace(PERFECT, infractions=made, **changes)  # type: ignore[arg-type]


def test_a_perfect_drive_has_the_highest_scores() -> None:
    scores = drive_figures(PERFECT)["scores"]
    assert scores["leaderboard_2_0"]["driving_score"] == scores["leaderboard_2_1"]["driving_score"] == 100.0
    assert scores["bench2drive"] == {"success": 1.0, "driving_score": 100.0, "efficiency": 100.0, "comfortness": 100.0}
    assert scores["nuplan"]["score"] == 1.0


@pytest.mark.parametrize(
    ("speeds", "other", "published"),
    [  # results that users of CARLA's leaderboard 2.0 have published (huggingface.co, AD_pdm-lite_carla-lb2)
        ((0.8922, 0.7946), (), 90.803279),  # ControlLoss/1102_0
        ((0.964, 0.964), (), 97.851664),  # HazardAtSideLaneTwoWays/1469_0
        ((0.9339, 0.1975), (), 74.419407),  # ParkingCrossingPedestrian/139_0
        ((0.5012,), (K.VEHICLE_COLLISION,), 51.0216),  # ConstructionObstacle/4179_0
        ((0.7963,), (K.YIELD,), 65.7223),  # YieldToEmergencyVehicle/4516_0
        ((0.1255,), (K.VEHICLE_COLLISION,), 44.259),  # MergerIntoSlowTraffic/1039_1
        ((), (K.STATIC_COLLISION,), 65.0),  # InterurbanActorFlow/447_2
    ],
)
def test_leaderboard_2_0_gives_what_carla_gave(
    speeds: tuple[float, ...], other: tuple[K, ...], published: float
) -> None:
    drive = did(*other, *((K.MIN_SPEED, ratio) for ratio in speeds))
    assert leaderboard_2_0(drive)["driving_score"] == pytest.approx(published, abs=1e-4)


def test_route_completion_and_the_way_outside_are_factors_in_both_leaderboards() -> None:
    drive = did(K.RED_LIGHT, K.STOP_SIGN, completed=0.5, outside_m=40.0)
    assert leaderboard_2_0(drive)["driving_score"] == pytest.approx(50.0 * 0.7 * 0.8 * 0.9)
    assert leaderboard_2_1(drive)["driving_score"] == pytest.approx(50.0 * 0.9 / (1.0 + 0.4 + 0.25))


@pytest.mark.parametrize(
    ("done", "expected"),
    [  # of CARLA's own description of the scores, rounded there to a tenth
        ([K.PEDESTRIAN_COLLISION], (50.0, 50.0)),
        ([K.PEDESTRIAN_COLLISION] * 2, (25.0, 33.3)),
        ([K.PEDESTRIAN_COLLISION] * 5, (3.1, 16.7)),
        ([K.VEHICLE_COLLISION, K.RED_LIGHT], (42.0, 47.6)),
        ([K.RED_LIGHT] * 3, (34.3, 45.5)),
        ([K.STOP_SIGN], (80.0, 80.0)),
        ([(K.MIN_SPEED, 0.5), K.SCENARIO_TIMEOUT], (100 * 0.85 * 0.7, 100 / 1.6)),
    ],
)
def test_both_leaderboards_as_carla_describes_them(done: list[K], expected: tuple[float, float]) -> None:
    found = [score(did(*done))["driving_score"] for score in (leaderboard_2_0, leaderboard_2_1)]
    assert found == pytest.approx(expected, abs=0.05)


def test_what_the_leaderboards_do_not_know_and_what_hits_a_standing_ego_costs_nothing() -> None:
    drive = did(K.SPEED_LIMIT, K.TIME_TO_COLLISION, K.DISCOMFORT, K.STANDSTILL, K.OFF_ROAD, K.WRONG_DIRECTION)
    stood = replace(drive, infractions=(Infraction(K.VEHICLE_COLLISION, 1, 0, (0.0, 0.0, 0.0), 0.0, "2"),))
    assert [
        score(each)["driving_score"] for each in (drive, stood) for score in (leaderboard_2_0, leaderboard_2_1)
    ] == ([100.0] * 4)


def test_bench2drive_wants_the_goal_without_infractions_and_forgives_slowness() -> None:
    slow = did((K.MIN_SPEED, 0.5))
    assert (bench2drive(slow)["success"], bench2drive(slow)["driving_score"]) == (1.0, 100.0)
    for failed in (did(K.RED_LIGHT), did(ended="standstill", completed=0.9), did(outside_m=1.0)):
        assert bench2drive(failed)["success"] == 0.0


def test_efficiency_is_the_mean_of_the_checks_with_traffic_up_to_ten_times_its_speed() -> None:
    sums = [(0, 0), (50, 100), (150, 200), (150, 200), (5000, 220), (5030, 240)]  # 0.5, 1, none, 242, 1.5
    drive = did(speed_checks=tuple(SpeedSums(*each) for each in sums))
    assert bench2drive(drive)["efficiency"] == pytest.approx(100.0)
    assert bench2drive(did(speed_checks=(SpeedSums(0, 0),)))["efficiency"] is None


def test_comfortness_is_the_share_of_smooth_segments_of_20_frames() -> None:
    rough = {name: values.copy() for name, values in PERFECT.comfort.items()}
    rough["yaw_rate"][25] = 1.0  # in the 2nd segment of 40
    rough["longitudinal_acceleration"][790] = -4.1  # in the last one
    assert bench2drive(did(comfort=rough))["comfortness"] == pytest.approx(100.0 * 38 / 40)
    rough["yaw_rate"][25] = 0.94
    assert bench2drive(did(comfort=rough))["comfortness"] == pytest.approx(100.0 * 39 / 40)


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"completed": 0.5}, (2.5 + 5 + 4 + 2) / 16),
        ({"completed": 0.2}, 0.0),  # no progress
        ({"min_time_to_collision_s": 0.9}, 11 / 16),
        ({"overspeed_m": 2.23 * 40.0 * 0.25}, (5 + 5 + 3 + 2) / 16),
        ({"overspeed_m": 1000.0}, 12 / 16),
        ({"max_off_road_m": 0.31}, 0.0),
        ({"max_oncoming_m": 2.1}, 0.5),
        ({"max_oncoming_m": 6.1}, 0.0),
        ({"comfort": {name: values + 5.0 for name, values in PERFECT.comfort.items()}}, 14 / 16),
    ],
)
def test_nuplan_by_hand(changes: dict[str, object], expected: float) -> None:
    assert nuplan(replace(PERFECT, **changes))["score"] == pytest.approx(expected)  # type: ignore[arg-type]


def test_nuplan_forgives_half_of_one_thing_hit_but_no_vehicle_and_nothing_that_others_cause() -> None:
    assert nuplan(did(K.STATIC_COLLISION))["score"] == 0.5
    assert nuplan(did(K.STATIC_COLLISION, K.STATIC_COLLISION))["score"] == 0.0
    assert nuplan(did(K.VEHICLE_COLLISION))["score"] == nuplan(did(K.PEDESTRIAN_COLLISION))["score"] == 0.0
    others = tuple(replace(each, at_fault=False) for each in did(K.VEHICLE_COLLISION).infractions)
    assert nuplan(replace(PERFECT, infractions=others))["score"] == 1.0


def test_variables_of_comfort_of_motions_in_closed_form() -> None:
    time_s = np.arange(400) * 0.05
    wave = np.sin(time_s)  # slow against the windows
    rows = np.column_stack([2.0 * wave, -3.0 * wave, 0.5 * wave, 3.0 * wave, -4.0 * wave])
    found = comfort_variables(rows, 0.05)
    expected = {
        "longitudinal_acceleration": 2.0 * np.sin(time_s),
        "lateral_acceleration": -3.0 * np.sin(time_s),
        "yaw_rate": 0.5 * np.sin(time_s),
        "yaw_acceleration": 0.5 * np.cos(time_s),
        "longitudinal_jerk": 2.0 * np.cos(time_s),
        "jerk": 5.0 * np.abs(np.cos(time_s)),
    }
    inner = slice(20, -20)
    for name, values in expected.items():
        assert found[name][inner] == pytest.approx(values[inner], abs=0.06 * np.abs(values).max()), name
    assert is_comfortable(found).all()


@pytest.mark.parametrize("count", [0, 1, 4])
def test_variables_of_comfort_of_drives_of_a_few_ticks(count: int) -> None:
    rows = np.outer(np.arange(count) * 0.05, np.ones(5))
    assert comfort_variables(rows, 0.05)["longitudinal_jerk"] == pytest.approx([float(count > 1)] * count)


def test_an_infraction_is_read_from_its_record_and_nonsense_is_refused() -> None:
    made = did((K.MIN_SPEED, 0.25)).infractions[0]
    assert Infraction.of_record(made.record()) == made
    assert {*UNITS} == {*K}
    for broken in ({}, {**made.record(), "kind": "bad"}, {**made.record(), "position_m": [1.0]}):
        with pytest.raises(ValueError, match="no infraction"):
            Infraction.of_record(broken)


def test_scores_of_several_drives_are_means_and_infractions_add_up() -> None:
    empty = replace(PERFECT, speed_checks=(SpeedSums(0, 0),))
    total = mean_figures([drive_figures(each) for each in (PERFECT, did(K.RED_LIGHT, K.RED_LIGHT), empty)])
    assert total["drives"] == 3
    assert total["infractions"] == {"red_light": 2}
    assert total["scores"]["leaderboard_2_0"]["driving_score"] == pytest.approx((100 + 49 + 100) / 3)
    assert total["scores"]["bench2drive"]["success"] == pytest.approx(2 / 3)
    assert total["scores"]["bench2drive"]["efficiency"] == 100.0


@pytest.mark.parametrize(
    "changes",
    [
        {"infractions": {"collision": "many"}},
        {"infractions": {"collision": -1}},
        {"infractions": ["collision"]},
        {"completed": np.nan},
        {"duration_s": np.inf},
        {"ended": 5},
        {"scores": {}},
        {"scores": dict.fromkeys(SCORES, 1.0)},
        {"scores": {name: {"driving_score": "1"} for name in SCORES}},
        {"scores": {name: {"driving_score": 10**400} for name in SCORES}},
    ],
    ids=str,
)
def test_figures_from_elsewhere_that_nothing_could_show_are_refused(changes: dict[str, Any]) -> None:
    good = json.loads(json.dumps(drive_figures(PERFECT)))
    assert checked_figures(good) is good
    with pytest.raises(ValueError, match=r"no score of a drive: \w|Out of range float values"):
        checked_figures({**good, **changes})


def test_figures_with_other_scores_are_shown_as_far_as_they_go() -> None:
    own, other = drive_figures(PERFECT), {**drive_figures(PERFECT), "scores": {name: {"new": 2.0} for name in SCORES}}
    figures = drives_figures({"other": checked_figures(other), "own": own})
    assert (figures["scores"]["nuplan"]["new"], figures["scores"]["nuplan"]["score"]) == (2.0, 1.0)
    assert [row[2].value for row in score_table(figures["scenes"], figures).rows] == [None, 100.0, 100.0]
