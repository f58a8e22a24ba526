"""The benchmark of scenes adds up phases, averages workers, and times each phase of real scenes."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from tools.bench.scene_timing import CASES, SceneCosts, _mean


def costs() -> SceneCosts:
    scene = {"draw": {"supervisor": 0.5}, "load": {"world": 1.0, "camera": 2.0}, "lead-in": {"world": 0.25}}
    later = {**scene, "ticks": {"camera": 4.0}}
    scenes = {CASES[0]: scene, CASES[1]: later, CASES[2]: {**later, "end of graph": {"nodes": 8.0}}}
    parts = {case: {"map": 0.1} for case in CASES}
    return SceneCosts(1, 100.0, {"imports": {"supervisor": 16.0}}, scenes, parts)


def test_rows_sum_up_phases_and_processes() -> None:
    rows = {name: cells for name, *cells in costs().rows()}
    assert rows["all phases"] == ["19.75", "7.75", "15.75"]
    assert rows["draw, load, lead-in"] == ["3.75"] * 3
    assert rows["load"] == ["3.00"] * 3
    assert rows["imports"] == ["16.00", "0.00", "0.00"]
    assert rows["end of graph"] == ["0.00", "0.00", "8.00"]
    assert rows["part: map"] == ["0.10"] * 3


def test_means_are_those_of_each_number() -> None:
    workers: list[Any] = [{"memory": 1.0, "load": {"world": 2.0}}, {"memory": 3.0, "load": {"world": 5.0}}]
    assert _mean(workers) == {"memory": 2.0, "load": {"world": 3.5}}


@pytest.mark.parametrize("maps", ["Town03", "Town01,Town02,Town03"])
def test_there_must_be_two_maps(refused: Callable[..., str], maps: str) -> None:
    assert "must be two maps" in refused("scene", "--maps", maps)


@pytest.mark.slow
def test_bench_scene_times_each_phase(bench: Callable[..., Any]) -> None:
    answer = bench("scene", "--maps", "Blocks,Town02", "--json")
    assert answer.code == 0, answer.err
    result = json.loads(answer.out)
    assert list(result["scenes"]) == list(CASES)
    for phases in result["scenes"].values():
        assert {"draw", "load", "lead-in", "ticks", "close"} <= phases.keys()
        assert sum(phases["load"].values()) > 0.0
        assert all(time_s > 0.0 for name, time_s in phases["ticks"].items() if name.startswith("camera"))
    assert result["start"]["start"]["fork server"] > 0.0
    assert result["memory_mib"] > 0.0
