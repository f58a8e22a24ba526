import json
from collections.abc import Callable
from typing import Any

import pytest


@pytest.mark.slow
def test_bench_rays_compares_with_one_merged_mesh_that_finds_the_same(bench: Callable[..., Any]) -> None:
    answer = bench("rays", "--map", "Blocks", "--actors", 12, "--radius", 100, "--frames", 1, "--json")
    assert answer.code == 0, answer.err
    timing = json.loads(answer.out)
    assert timing["rays"] == 128 * 2048
    assert timing["near_actors"] > 6
    assert timing["agreement"] > 0.9999
    assert [cost["name"] for cost in timing["whole"]][-1] == "radars"
    for cost in (*timing["whole"], *timing["parts"], *timing["merged"]):
        assert 0 < cost["least_ms"] <= cost["wall_ms"]
        assert cost["rays_per_s"] > 0
    assert timing["whole_ratio"] > timing["cast_ratio"] > 0
