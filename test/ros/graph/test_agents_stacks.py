"""Stacks of two agents in one graph: each has an evaluator and a file of figures, and one can use the other's boxes."""

import json
import shlex
import sys
from pathlib import Path
from typing import Any

import pytest
from commands import Simbev
from diagnostic_msgs.msg import DiagnosticArray
from subscriber import keep, outside_node

pytestmark = [pytest.mark.graph, pytest.mark.slow]

TWO_CARS = """
seed: 3
scenes: [{map: Blocks, train: 1}]
time: {warm_up_s: 1, duration_s: 0.5}
agents:
  - {name: ego, rig: rig.yaml, evaluation: {FIRST}}
  - {name: van, rig: rig.yaml, blueprint: vehicle.van, near: {distance_m: 25}, evaluation: {SECOND}}
traffic: {vehicles: 10, pedestrians: 5, spawn_radius_m: 100}
annotation: {bev: {rows: 50, columns: 50}}
"""
RIG = "sensors: [{type: lidar, name: lidar, pose: {z_m: 2.8}, channels: 16, columns: 128}]"


def evaluated(simbev: Simbev, folder: Path, first: str, second: str, *options: str) -> tuple[Any, Any, str]:
    """Figures of both agents' stacks with these sections, and the output of the command."""
    config = folder / "cars.yaml"
    config.write_text(TWO_CARS.replace("{FIRST}", first).replace("{SECOND}", second), encoding="utf-8")
    (folder / "rig.yaml").write_text(RIG, encoding="utf-8")
    code, output = simbev("run", config, "--evaluate", folder / "figures.json", *options).finish(180)
    assert code == 0, output
    own, other = (json.loads((folder / name).read_text()) for name in ("figures.json", "figures_van.json"))
    return own, other, output


def echo(*options: str) -> str:
    """Command of a stack that answers with the ground truth."""
    return shlex.join([sys.executable, str(Path(__file__).with_name("echo_stack.py")), "--reports", *options])


def test_stacks_of_two_agents_are_each_judged_by_the_truth_of_their_agent(simbev: Simbev, tmp_path: Path) -> None:
    first, second = "{participant: echo}", "{participant: van_echo, truth: joint}"
    stacks = ("--stack", echo(), "--stack", f"van={echo('--agent', 'van')}")
    published: list[DiagnosticArray] = []
    with outside_node("listener") as (node, spin_until):
        node.create_subscription(DiagnosticArray, "/evaluation", keep(published), 100)
        own, other, output = evaluated(simbev, tmp_path, first, second, *stacks)
        spin_until(lambda: sum("10 frames" in each.status[0].message for each in published) >= 2)
    values = {entry.key: entry.value for entry in published[-1].status[0].values}
    assert (values["frames"], values["missed"], values["mAP_iou"], values["mean_IoU"]) == ("10", "0", "1", "1")
    for figures in (own, other):
        assert (figures["frames"]["evaluated"], figures["frames"]["answered_boxes"]) == (10, 10)
        assert (figures["frames"]["missed"], figures["frames"]["answered_grids"]) == (0, 10)
        assert figures["detection"]["iou"]["mAP"] == figures["detection"]["distance"]["mAP"] == 1.0
        assert set(figures["segmentation"]["mean_IoU_at"].values()) == {1.0}
        assert 0 < figures["latency_ms"]["p50"] <= figures["latency_ms"]["p99"] < 60_000
    assert "agent" not in own and (other["agent"], other["truth"]) == ("van", "joint")
    assert own["detection"]["boxes"] != other["detection"]["boxes"]
    assert "stack of van" in output and "0 frames missed" in output


def test_a_cooperative_stack_finds_more_of_the_joint_truth_than_the_reference_stack(
    simbev: Simbev, tmp_path: Path
) -> None:
    seen = "truth: joint, min_points: 5, classes: [car, truck, bus, pedestrian, road]"
    found = {}
    for stack in ("reference", "cooperative"):
        folder = tmp_path / stack
        folder.mkdir()
        own, other, output = evaluated(simbev, folder, f"{{{seen}, stack: {stack}}}", f"{{{seen}, stack: reference}}")
        assert "warning" not in output, output
        for figures in (own, other):
            assert (figures["frames"]["answered_boxes"], figures["frames"]["missed"]) == (10, 0)
        found[stack] = own["detection"]["distance"]["mAP"], other["detection"]["distance"]["mAP"]
    assert found["cooperative"][0] > found["reference"][0]
    assert found["cooperative"][1] == found["reference"][1]
