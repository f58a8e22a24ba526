"""``python -m tools.bench production``: arguments that it refuses."""

from collections.abc import Callable
from pathlib import Path


def test_bench_production_refuses_a_bad_list_of_numbers(refused: Callable[..., str], tmp_path: Path) -> None:
    message = refused("production", tmp_path, "--scenes", "1,x")
    assert message == "error: --scenes: must be numbers from 2 to 500001, separated by commas, not '1,x'\n"


def test_bench_production_refuses_a_folder_without_scenes(refused: Callable[..., str], tmp_path: Path) -> None:
    message = refused("production", tmp_path, "--folder", tmp_path)
    assert message == f"error: {tmp_path}: has no finished scene to copy\n" and list(tmp_path.iterdir()) == []
