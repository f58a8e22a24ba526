"""``python -m tools.bench cameras``: every quality that is asked for, whole and in parts."""

import json
from collections.abc import Callable
from typing import Any

import pytest


@pytest.mark.slow
@pytest.mark.gl
def test_a_frame_is_its_parts(bench: Callable[..., Any]) -> None:
    small = ("--map", "Blocks", "--actors", 10, "--size", "64x36", "--frames", 2, "--processes", 2)
    answer = bench("cameras", *small, "--quality", "low", "--json")
    assert answer.code == 0, answer.err
    result = json.loads(answer.out)
    assert (result["cameras"], result["width_px"], result["height_px"], result["frames"]) == (6, 64, 36, 2)
    assert result["processes"] == 2
    assert result["actors"] >= 11 and result["triangles"] > 100_000
    [timing] = result["qualities"]
    parts = {part["name"]: part["wall_ms"] for part in timing["parts"]}
    assert timing["quality"] == "low" and min(timing["total"]["wall_ms"], timing["total"]["cpu_ms"]) > 0.0
    assert {"shadows", "geometry, labels, flow", "read-back", "rest"} <= parts.keys()
    assert sum(name.startswith("shading") for name in parts) >= 3
    assert min(parts.values()) > 0.0
    assert parts["geometry, labels, flow"] > parts["read-back"]  # of half a million triangles against a few pixels


@pytest.mark.parametrize("size", ["1600", "0x9", "1600x9000", "axb"])
def test_a_size_that_no_picture_has_is_refused(refused: Callable[..., str], size: str) -> None:
    assert f"--size {size}: must be WIDTHxHEIGHT" in refused("cameras", "--size", size)
