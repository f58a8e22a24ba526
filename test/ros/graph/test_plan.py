"""A configuration leads to the right processes, nodes and parameters; nothing is started."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from pydantic import ValidationError

from simbev_ros.config.agents import Agent
from simbev_ros.config.annotation import Annotation
from simbev_ros.config.camera import Camera
from simbev_ros.config.draw import Distribution
from simbev_ros.config.drive import Drive
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.load import load_scenario
from simbev_ros.config.positioning import Gnss
from simbev_ros.config.rendering import Device, Rendering
from simbev_ros.config.scenario import GraphConfig, Scenario
from simbev_ros.config.v2x import V2x
from simbev_ros.ros.graph.plan import NodePlan, plan_processes


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


def with_agents(number: int, *, cameras: bool = True, **changes: Any) -> Scenario:
    """The paper's scenario with this number of agents, ego, car_1, car_2, …, all with its rig."""
    paper = load_scenario("paper")
    sensors = [sensor for sensor in paper.rig.sensors if cameras or not isinstance(sensor, Camera)]
    rig = paper.rig.model_copy(update={"sensors": tuple(sensors)})
    agents = tuple(Agent.model_validate({"name": f"car_{k}", "rig": rig} | changes) for k in range(1, number))
    return paper.model_copy(update={"rig": rig, "agents": agents})


def processes_of(scenario: Scenario, cores: int) -> list[str]:
    """Names of the nodes of each process that has neither the world nor cameras, joined by a plus sign."""
    processes = plan_processes(scenario, 1, live=False, dataset=None, cores=cores)
    assert [node.name for process in processes[:2] for node in process] == ["world", "camera"]
    return ["+".join(node.name for node in process) for process in processes[2:]]


def numbered(number: int, *names: str) -> list[str]:
    return [f"{name}_{k}" for name in names for k in range(number)]


BOXES, VIEWS, SURROUNDINGS = "annotator_boxes", "annotator_views", "annotator_surroundings"
ALONE, LIGHT = "gnss+imu", "gnss+imu+joint"
ON_TWO_CORES = ["lidar+radar", LIGHT, "annotator"]
ON_EIGHT_CORES = ["lidar", "radar", LIGHT, BOXES, SURROUNDINGS]
ON_SIXTEEN_CORES = [*numbered(2, "lidar"), "radar", LIGHT, *numbered(2, BOXES, SURROUNDINGS)]


@pytest.mark.parametrize(
    ("agents", "cores", "expected"),
    [
        *((agents, 2, ON_TWO_CORES) for agents in (2, 4, 8)),
        *((agents, 8, ON_EIGHT_CORES) for agents in (2, 4, 8)),
        *((agents, 16, ON_SIXTEEN_CORES) for agents in (2, 4, 8)),
        (1, 2, ["lidar+radar", ALONE, "annotator"]),
        (1, 8, ["lidar", "radar", ALONE, BOXES, SURROUNDINGS]),
        *((1, cores, ["lidar", "radar", ALONE, BOXES, VIEWS, SURROUNDINGS]) for cores in (16, 64)),
        *((n, 64, [*numbered(n, "lidar"), "radar", LIGHT, *numbered(n, BOXES, VIEWS, SURROUNDINGS)]) for n in (2, 4)),
        (8, 64, [*numbered(8, "lidar"), "radar", LIGHT, *numbered(8, BOXES, SURROUNDINGS)]),
    ],
)
def test_agents_are_divided_among_nodes_for_every_eight_cores(agents: int, cores: int, expected: list[str]) -> None:
    assert processes_of(with_agents(agents), cores) == expected


@pytest.mark.parametrize("cores", [2, 8, 16, 64])
@pytest.mark.parametrize("agents", [2, 4, 8])
def test_nodes_of_a_kind_serve_each_agent_once(agents: int, cores: int) -> None:
    processes = plan_processes(with_agents(agents), 5, live=False, dataset=None, cores=cores)
    nodes = [node for process in processes[1:] for node in process]
    for kind in ("lidar", "radar", "gnss", "imu", "annotator"):
        by_scope: dict[str, list[NodePlan]] = {}
        for node in (node for node in nodes if node.kind == kind):
            by_scope.setdefault(str(node.parameters.get("scope")), []).append(node)
        for alike in by_scope.values():
            shares = [(node.parameters.get("agent_share", 0), node.parameters.get("agent_shares", 1)) for node in alike]
            assert shares == [(share, len(alike)) for share in range(len(alike))]
    assert {node.agent for node in nodes} == {""}
    assert len({node.name for node in nodes}) == len(nodes)
    assert processes[0][0].parameters["participants"] == [node.name for node in nodes]


def test_a_single_agent_has_its_nodes_in_its_namespace_and_no_shares() -> None:
    for cores in (2, 8, 16, 64):
        for process in plan_processes(with_agents(1), 2, live=False, dataset=None, cores=cores)[1:]:
            for node in process:
                assert node.agent == "ego"
                assert not {"agent_share", "agent_shares", "box_readers"} & node.parameters.keys()


def test_a_node_joins_the_boxes_of_all_agents_and_annotators_wait_for_it() -> None:
    processes = plan_processes(with_agents(2), 1, live=False, dataset=None, cores=16)
    nodes = [node for process in processes[1:] for node in process]
    assert [node.name for node in nodes if node.kind == "joint"] == ["joint"]
    assert {node.parameters["box_readers"] for node in nodes} == {1}


def test_a_node_carries_the_messages_between_agents_beside_the_one_that_joins_boxes() -> None:
    scenario = with_agents(2).model_copy(update={"v2x": V2x()})
    assert processes_of(scenario, 2) == ["lidar+radar", f"{LIGHT}+v2x", "annotator"]
    nodes = [node for process in plan_processes(scenario, 1, live=False, dataset=None)[1:] for node in process]
    assert {node.parameters["box_readers"] for node in nodes} == {2}


def test_a_drive_has_a_referee_beside_the_light_sensors() -> None:
    scenario = with_agents(2).model_copy(update={"drive": Drive()})
    assert processes_of(scenario, 2) == ["lidar+radar", f"{LIGHT}+referee", "annotator"]


def test_only_agents_with_lidars_count_for_the_number_of_lidar_nodes() -> None:
    scenario = with_agents(4)
    blind = [agent.rig.model_copy(update={"sensors": agent.rig.of_type(Gnss)}) for agent in scenario.agents[1:]]
    others = [agent.model_copy(update={"rig": rig}) for agent, rig in zip(scenario.agents[1:], blind, strict=True)]
    names = processes_of(scenario.model_copy(update={"agents": (scenario.agents[0], *others)}), 64)
    assert names[:3] == ["lidar_0", "lidar_1", "radar"]
    assert names[-1] == "annotator_surroundings_3"


def test_views_are_annotated_if_any_agent_has_them() -> None:
    blind = with_agents(2, cameras=False)
    paper = load_scenario("paper")
    seeing = blind.agents[0].model_copy(update={"rig": paper.rig.model_copy(update={"agent": "car_1"})})
    silent = seeing.model_copy(update={"annotation": Annotation(views=False)})
    for agent, expected in ((blind.agents[0], False), (seeing, True), (silent, False)):
        scenario = blind.model_copy(update={"agents": (agent,)})
        processes = plan_processes(scenario, 0, live=False, dataset=None, cores=64)
        assert any(node.name.startswith(VIEWS) for process in processes for node in process) == expected


def test_camera_processes_get_the_cameras_of_all_agents_in_blocks() -> None:
    processes = plan_processes(with_agents(3), 4, live=False, dataset=None, cores=8)[1:5]
    served = [list(node.parameters["sensors"]) for process in processes for node in process]  # type: ignore[call-overload]
    cameras = [camera.name for camera in load_scenario("paper").rig.of_type(Camera)]
    assert [name for names in served for name in names] == [
        f"{agent}/{camera}" for agent in ("ego", "car_1", "car_2") for camera in cameras
    ]
    assert [len(names) for names in served] == [4, 5, 4, 5]
    assert [len({name.split("/")[0] for name in names}) for names in served] == [1, 2, 2, 1]


def test_the_plan_covers_the_maximum_of_a_drawn_number_of_agents() -> None:
    scenario = with_agents(2, count=Distribution(uniform=(0, 3)))
    assert [rig.agent for rig in scenario.rigs] == ["ego", "car_1_1", "car_1_2", "car_1_3"]
    [camera] = plan_processes(scenario, 1, live=False, dataset=None)[1]
    assert len(camera.parameters["sensors"]) == 4 * 6  # type: ignore[arg-type]
    assert processes_of(scenario, 64)[:4] == numbered(4, "lidar")


def test_the_world_does_not_run_far_ahead_if_another_agent_is_driven_from_outside() -> None:
    for driver, expected in (("traffic", 8), ("twist", 3)):
        [world] = plan_processes(with_agents(2, driver=driver), 1, live=False, dataset=None, cores=16)[0]
        assert world.parameters["window_ticks"] == expected


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


def test_each_evaluated_agent_has_an_evaluator_and_a_file_of_figures(tmp_path: Path) -> None:
    section = {"truth": "joint", "participant": "fusion"}
    paper = load_scenario("paper")
    car = Agent.model_validate({"name": "car", "rig": paper.rig.model_dump(), "evaluation": section})
    scenario = scenario_with_evaluation({}, agents=(car,))
    processes = plan_processes(scenario, 1, live=False, dataset=None, figures=tmp_path)
    evaluators = [node for process in processes for node in process if node.kind == "evaluator"]
    assert [(node.name, node.agent, node.parameters.get("agent")) for node in evaluators] == [
        ("evaluator", "", None),
        ("evaluator_car", "", "car"),
    ]
    assert all(node.parameters["outside_participants"] == ["fusion"] for node in evaluators)
    assert [node.parameters["input_topic"] for node in evaluators] == ["/ego/lidar/points", "/car/lidar/points"]
    assert [node.parameters["figures"] for node in evaluators] == [
        str(tmp_path / name) for name in ("figures.json", "figures_car.json")
    ]
    read = ["/ego/boxes", "/ego/bev/labels", "/ego/lidar/points"]
    read += ["/world/boxes", "/car/bev/labels", "/car/lidar/points"]
    sensing = [node for process in processes[1:] for node in process if node.kind != "evaluator"]
    assert all(node.parameters["evaluated_topics"] == read for node in sensing)
    names = [node.name for process in processes[1:] for node in process]
    assert processes[0][0].parameters["participants"] == [*names, "fusion"]
