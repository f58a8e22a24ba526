"""A configuration leads to the right processes, nodes and parameters; nothing is started."""

from collections.abc import Sequence
from pathlib import Path

import pytest
from pydantic import ValidationError

from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.load import load_scenario
from simbev_ros.config.rendering import Device, Rendering
from simbev_ros.config.scenario import GraphConfig, Scenario
from simbev_ros.graph.plan import NodePlan, plan_processes


def cameras(number: int, **rendering: object) -> list[NodePlan]:
    scenario = load_scenario("paper").model_copy(update={"rendering": Rendering.model_validate(rendering)})
    return [
        node
        for process in plan_processes(scenario, number, live=False, dataset=None)
        for node in process
        if node.kind == "camera"
    ]


def rendering_of(node: NodePlan) -> Rendering:
    return Rendering.model_validate_json(str(node.parameters["rendering"]))


def devices(nodes: Sequence[NodePlan]) -> list[Device]:
    return [rendering_of(node).device_of(int(str(node.parameters["process"]))) for node in nodes]


def test_with_many_cores_ray_casting_nodes_and_labels_have_processes_of_their_own() -> None:
    scenario = load_scenario("paper")
    few, many, most = (
        [[node.name for node in process] for process in plan_processes(scenario, 1, live=False, dataset=None, cores=n)]
        for n in (2, 8, 16)
    )
    apart = [["world"], ["camera"], ["lidar"], ["radar"], ["gnss", "imu"]]
    assert few == [["world"], ["camera"], ["lidar", "radar"], ["gnss", "imu"], ["annotator"]]
    assert many == [*apart, ["annotator_boxes"], ["annotator_surroundings"]]
    assert most == [*apart, ["annotator_boxes"], ["annotator_views"], ["annotator_surroundings"]]


def test_the_world_runs_far_ahead_only_on_many_cores_and_if_nobody_outside_reacts_to_it() -> None:
    paper = load_scenario("paper")
    waited_for = {"graph": GraphConfig(participants=("stack",))}
    driven = {"ego": paper.ego.model_copy(update={"driver": "twist"})}
    chosen = {"graph": GraphConfig(window_ticks=5)}
    for changes, few, many in (({}, 3, 8), (waited_for, 3, 3), (driven, 3, 3), (chosen, 5, 5)):
        scenario = paper.model_copy(update=changes)
        for cores, expected in ((2, few), (16, many)):
            [world] = plan_processes(scenario, 1, live=False, dataset=None, cores=cores)[0]
            assert world.parameters["window_ticks"] == expected


def test_devices_in_place_of_the_configured_ones_leave_the_recorded_configuration_as_it_is(tmp_path: Path) -> None:
    scenario, drawing = load_scenario("paper"), Rendering(quality="low", gpus=(2,))
    processes = plan_processes(scenario, 2, live=False, dataset=tmp_path, rendering=drawing)
    nodes = [node for process in processes for node in process]
    assert [rendering_of(node) for node in nodes if node.kind == "camera"] == [drawing, drawing]
    assert [node.parameters["config"] for node in nodes if node.kind == "recorder"] == [scenario.as_yaml()]


def test_one_camera_process_serves_the_whole_rig() -> None:
    [node] = cameras(1)
    assert (node.name, node.parameters["process"]) == ("camera", 0)
    assert rendering_of(node) == Rendering()
    assert len(set(node.parameters["sensors"])) == 6  # type: ignore[call-overload]


def test_several_processes_share_the_cameras_and_the_gpus() -> None:
    nodes = cameras(4, gpus=[2, 5], quality="low")
    assert [node.name for node in nodes] == ["camera_0", "camera_1", "camera_2", "camera_3"]
    assert devices(nodes) == [2, 5, 2, 5]
    assert {rendering_of(node).quality for node in nodes} == {"low"}
    names = [name for node in nodes for name in node.parameters["sensors"]]  # type: ignore[attr-defined]
    assert len(names) == len(set(names)) == 6


def test_gpus_found_by_egl_are_used_in_turn_and_an_empty_list_means_the_cpu() -> None:
    assert devices(cameras(2)) == ["auto", "auto"]
    assert [node.parameters["process"] for node in cameras(2)] == [0, 1]
    assert devices(cameras(2, gpus=[])) == ["cpu", "cpu"]


@pytest.mark.parametrize(
    "bad",
    [{"gpus": [1, 1]}, {"gpus": [-1]}, {"gpus": "all"}, {"quality": "best"}, {"processes": 0}, {"processes": "all"}],
)
def test_invalid_rendering_options_are_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Rendering.model_validate(bad)


def test_ray_casting_sensors_share_a_process_and_light_sensors_another() -> None:
    processes = plan_processes(load_scenario("paper"), 1, live=False, dataset=None)
    assert [[node.kind for node in process] for process in processes] == [
        ["world"], ["camera"], ["lidar", "radar"], ["gnss", "imu"], ["annotator"]
    ]  # fmt: skip


def scenario_with_evaluation(section: dict[str, object], **parts: object) -> Scenario:
    return load_scenario("paper").model_copy(update={"evaluation": Evaluation.model_validate(section), **parts})


def test_the_world_waits_for_the_evaluator_and_its_participant() -> None:
    scenario = scenario_with_evaluation(
        {"participant": "detector"}, graph=GraphConfig(participants=("planner", "detector"))
    )
    processes = plan_processes(scenario, 1, live=False, dataset=None)
    plain = plan_processes(load_scenario("paper"), 1, live=False, dataset=None)
    assert [node.name for node in processes[-1]] == ["evaluator"]
    assert [len(each) for each in processes[:-1]] == [len(each) for each in plain]
    world, before = processes[0][0].parameters, plain[0][0].parameters
    names = [node.name for process in processes[1:] for node in process]
    assert world["participants"] == [*names, "planner", "detector"]
    assert world["state_readers"] == before["state_readers"]


@pytest.mark.parametrize("live", [True, False])
def test_reliable_sensor_topics_are_a_matter_of_real_time(live: bool) -> None:
    scenario = load_scenario("paper")
    graph = scenario.graph.model_copy(update={"live_reliability": "reliable"})
    for chosen, expected in ((scenario, False), (scenario.model_copy(update={"graph": graph}), live)):
        _, *behind = plan_processes(chosen, 1, live=live, dataset=Path("dataset"))
        assert all(node.parameters["reliable"] == expected for process in behind for node in process)


def test_nodes_wait_for_the_evaluator_on_topics_that_it_reads() -> None:
    processes = plan_processes(scenario_with_evaluation({}), 1, live=False, dataset=None)
    read = ["/ego/boxes", "/ego/bev/labels", "/ego/lidar/points"]
    assert all(node.parameters["evaluated_topics"] == read for process in processes[1:-1] for node in process)
    assert processes[-1][0].parameters["input_topic"] == "/ego/lidar/points"
