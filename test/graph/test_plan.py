"""Which processes a configuration means; nothing is started."""

import pytest
from pydantic import ValidationError

from simbev_ros.config.load import load_scenario
from simbev_ros.config.rendering import Rendering
from simbev_ros.graph.plan import NodePlan, planned_processes


def cameras(number: int, **rendering: object) -> list[NodePlan]:
    scenario = load_scenario("paper").model_copy(update={"rendering": Rendering.model_validate(rendering)})
    return [
        node
        for process in planned_processes(scenario, number, live=False, dataset=None)
        for node in process
        if node.kind == "camera"
    ]


def test_one_camera_process_serves_the_whole_rig() -> None:
    [node] = cameras(1)
    assert (node.name, node.parameters["device"], node.parameters["quality"]) == ("camera", "auto", "medium")
    assert len(set(node.parameters["sensors"])) == 6  # type: ignore[call-overload]


def test_several_processes_share_the_cameras_and_the_gpus() -> None:
    nodes = cameras(4, gpus=[2, 5], quality="low")
    assert [node.name for node in nodes] == ["camera_0", "camera_1", "camera_2", "camera_3"]
    assert [node.parameters["device"] for node in nodes] == ["2", "5", "2", "5"]
    assert {node.parameters["quality"] for node in nodes} == {"low"}
    names = [name for node in nodes for name in node.parameters["sensors"]]  # type: ignore[attr-defined]
    assert len(names) == len(set(names)) == 6


def test_gpus_that_egl_finds_are_taken_in_turn_and_none_means_the_cpu() -> None:
    assert [(n.parameters["device"], n.parameters["turn"]) for n in cameras(2)] == [("auto", 0), ("auto", 1)]
    assert [node.parameters["device"] for node in cameras(2, gpus=[])] == ["cpu", "cpu"]


@pytest.mark.parametrize(
    "bad",
    [{"gpus": [1, 1]}, {"gpus": [-1]}, {"gpus": "all"}, {"quality": "best"}, {"processes": 0}, {"processes": "all"}],
)
def test_what_cannot_be_is_refused(bad: dict[str, object]) -> None:
    with pytest.raises(ValidationError):
        Rendering.model_validate(bad)


def test_sensors_that_share_meshes_or_take_little_share_a_process() -> None:
    processes = planned_processes(load_scenario("paper"), 1, live=False, dataset=None)
    assert [[node.kind for node in process] for process in processes] == [
        ["world"], ["camera"], ["lidar", "radar"], ["gnss", "imu"], ["annotator"]
    ]  # fmt: skip
