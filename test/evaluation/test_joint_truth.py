"""Stacks of several agents, judged against what the agents see together."""

from pathlib import Path

import cooperative_scene as made
import numpy as np
import pytest

from simbev_ros.config.evaluation import Evaluation as EvaluationSection
from simbev_ros.config.evaluation import Truth
from simbev_ros.dataset import open_dataset
from simbev_ros.dataset.scene import Scene
from simbev_ros.evaluation.evaluation import Evaluation, evaluate
from simbev_ros.evaluation.filters import BoxFilter
from simbev_ros.evaluation.joint_truth import boxes_in_reach
from simbev_ros.evaluation.live.answer_join import BOXES, LABELS, POSE, JoinCounts, OpenFrame, pose_of
from simbev_ros.evaluation.live.live_evaluation import LiveEvaluation
from simbev_ros.evaluation.metrics.boxes import Predictions
from simbev_ros.evaluation.options import EvaluationOptions, options_of
from simbev_ros.evaluation.predictions.dataset_predictions import open_predictions, write_predictions
from simbev_ros.evaluation.predictions.predicted_boxes import PredictedBoxes, Reference
from simbev_ros.evaluation.slices import TableSlice
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.types import Table
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.simulation.annotation.boxes.joint import join_boxes

SEEN = TableSlice(boxes=BoxFilter(points=(1, np.inf)))


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return open_dataset(made.record(tmp_path_factory.mktemp("cars"))).scenes[0]


def answers(scene: Scene, *tables: dict[int, Table]) -> Predictions:
    """Objects of all tables of each tick, once each, but for the agent itself."""
    joined: dict[int, Table] = {}
    for tick in range(made.TICKS):
        rows = np.concatenate([each[tick] for each in tables])
        rows = rows[rows["id"] != scene.view.ego_id]
        joined[tick] = rows[np.unique(rows["id"], return_index=True)[1]]
    return made.as_answers(joined)


def judge(
    scene: Scene, predictions: Predictions, file: Path, truth: Truth = "joint", frame_id: str = "map"
) -> Evaluation:
    write_predictions(file, [(made.NAME, predictions)], frame_id)
    opened = open_predictions(file).for_dataset([made.NAME])
    return evaluate([scene], opened, EvaluationOptions(slices=(SEEN,), truth=truth))


def share_found(evaluation: Evaluation) -> float:
    frames = evaluation.frames[made.NAME]
    return float(frames["found"].sum() / frames["boxes"].sum())


@pytest.mark.parametrize("agent", ["ego", "car"])
def test_perfect_answers_of_both_together_are_perfect_and_those_of_one_alone_are_not(
    scene: Scene, tmp_path: Path, agent: str
) -> None:
    seen = {name: {tick: made.seen(name, tick) for tick in range(made.TICKS)} for name in ("ego", "car")}
    judged = scene.of_agent(agent)
    own = answers(judged, seen[agent])
    fused = judge(judged, answers(judged, *seen.values()), tmp_path / "fused.parquet")
    alone = judge(judged, own, tmp_path / "own.parquet")
    by_itself = judge(judged, own, tmp_path / "self.parquet", truth="own")
    assert (share_found(fused), share_found(by_itself)) == (1.0, 1.0)
    assert share_found(alone) == pytest.approx(3 / 4)  # of three cars and the other agent, one is hidden
    for evaluation, expected in ((fused, 1.0), (by_itself, 1.0), (alone, 3 / 4)):
        for method in ("iou", "distance"):
            assert evaluation.detections[SEEN].mean_ap(method) == pytest.approx(expected, abs=0.01)


def test_the_joint_truth_has_the_points_of_both_and_the_distances_of_one() -> None:
    spec = made.spec(box_radius_m=35.0)
    tables = {agent: made.boxes(agent, 2) for agent in ("ego", "car")}
    joint = join_boxes([*tables], tables).rows
    points = dict.fromkeys((made.EGO, made.CAR, *made.PLACES_M), 0)
    for table in tables.values():
        for row in table:
            points[int(row["id"])] += int(row["lidar_points"])
    for agent, hidden in (("ego", {made.EGO}), ("car", {made.CAR, made.SEEN_BY_EGO, made.EGO})):
        found = boxes_in_reach(joint, agent_view(spec, agent))
        assert set(found["id"].tolist()) == points.keys() - hidden  # the ego and a car are 44 m and more from the car
        assert found["lidar_points"].tolist() == [points[number] for number in found["id"].tolist()]
        own = tables[agent][np.isin(tables[agent]["id"], found["id"])]
        for name in set(own.dtype.names or ()) - {"lidar_points", "radar_points", "visibility", "valid", "difficulty"}:
            np.testing.assert_array_equal(found[name], own[name])
        assert (found["valid"] == (found["lidar_points"] > 0)).all()
        assert (found["difficulty"][found["lidar_points"] == 0] > 0).all()


def test_answers_may_be_in_the_frame_of_another_agent(scene: Scene, tmp_path: Path) -> None:
    tables = {tick: made.boxes("ego", tick) for tick in range(made.TICKS)}
    for tick, table in tables.items():  # the car looks back
        table["x"], table["y"] = made.place_m("car", tick)[0] - table["x"], made.place_m("car", tick)[1] - table["y"]
        table["yaw"] += np.pi
    found = judge(scene, made.as_answers(tables), tmp_path / "in_car.parquet", frame_id="car/base_link")
    assert share_found(found) == 1.0
    assert found.detections[SEEN].mean_ap("iou") == pytest.approx(1)
    with pytest.raises(InputError, match=r"there is no 'bus/base_link' in scene .*ego/lidar, car/base_link, car/lidar"):
        judge(scene, made.as_answers(tables), tmp_path / "in_bus.parquet", frame_id="bus/base_link")


def test_a_scene_with_one_agent_has_no_joint_truth(tmp_path: Path) -> None:
    single = open_dataset(made.single.record(tmp_path / "single")).scenes[0]
    with pytest.raises(InputError, match=r"cannot be evaluated, because the bag lacks world/boxes$"):
        judge(single, made.single.as_predicted(), tmp_path / "boxes.parquet")
    with pytest.raises(InputError, match=r"^world/boxes: the joint boxes of Blocks-0000 have no column ego.distance$"):
        boxes_in_reach(made.boxes("ego", 0), single.view)


def test_nuscenes_metrics_are_for_the_own_truth() -> None:
    with pytest.raises(InputError, match=r"^nuscenes: these metrics are for the truth of one agent"):
        EvaluationOptions(truth="joint", nuscenes=True)


def test_the_configuration_chooses_the_truth() -> None:
    assert options_of(EvaluationSection(truth="joint")).truth == "joint"


@pytest.mark.parametrize("agent", ["ego", "car"])
def test_live_and_recorded_frames_are_judged_alike_also_in_the_frame_of_another_agent(
    scene: Scene, tmp_path: Path, agent: str
) -> None:
    judged, other = scene.of_agent(agent), {"ego": "car", "car": "ego"}[agent]
    predictions = answers(judged, {tick: made.seen(agent, tick) for tick in range(made.TICKS)})
    boxes, in_other = predictions.boxes, f"{other}/base_link"
    for row, tick in enumerate(boxes.frame.tolist()):
        other_from_map = np.linalg.inv(judged[tick].others[other].map_from_ego)
        boxes.center_m[row] = other_from_map[:3, :3] @ boxes.center_m[row] + other_from_map[:3, 3]
        boxes.yaw_rad[row] -= made.YAW_RAD[other]
    recorded = judge(judged, predictions, tmp_path / "boxes.parquet", frame_id=in_other)
    assert share_found(recorded) == 3 / 4
    live = LiveEvaluation(judged.view, recorded.options)
    answered = PredictedBoxes.with_reference(predictions, Reference(in_other, "/boxes"))
    for frame in judged:
        truth = {
            POSE: frame.map_from_ego,
            BOXES: boxes_in_reach(frame["world/boxes"], judged.view),
            LABELS: frame["bev/labels"],
            pose_of(other): frame.others[other].map_from_ego,
        }
        live.add_frame(OpenFrame(frame.tick, truth, {"/boxes": answered.at_ticks([frame.tick])}))
    tally = live.finish(JoinCounts()).tally
    np.testing.assert_array_equal(tally.frames["boxes"], recorded.frames[made.NAME]["boxes"])
    np.testing.assert_array_equal(tally.frames["found"], recorded.frames[made.NAME]["found"])
