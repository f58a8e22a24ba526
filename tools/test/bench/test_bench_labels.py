import json
from collections.abc import Callable
from typing import Any

import pytest


@pytest.mark.slow
@pytest.mark.gl
def test_bench_labels_compares_with_a_plain_grid_that_is_the_same(bench: Callable[..., Any]) -> None:
    answer = bench("labels", "--map", "Blocks", "--actors", 12, "--radius", 100, "--frames", 2, "--json")
    assert answer.code == 0, answer.err
    timing = json.loads(answer.out)
    assert timing["near_actors"] > 6
    assert timing["boxes"] > 10
    assert timing["points"] > 100_000
    assert timing["agreement"] > 0.99999
    costs = {cost["name"]: cost for cost in timing["costs"]}
    assert {"grid", "boxes", "points inside boxes", "views of 6 cameras", "vector map", "occupancy"} <= set(costs)
    for cost in (*costs.values(), timing["every_tick"], timing["plain"]):
        assert 0 < cost["least_ms"] <= cost["wall_ms"]
        assert cost["cpu_ms"] > 0
    parts = [costs[name]["least_ms"] for name in ("grid", "boxes", "points inside boxes")]
    assert timing["every_tick"]["least_ms"] >= sum(parts) * 0.999
    assert timing["ratio"] == pytest.approx(timing["plain"]["wall_ms"] / costs["grid"]["wall_ms"])
