"""The option --workers of generate: what it means, and what it refuses before anything is made."""

from collections.abc import Callable
from pathlib import Path

import pytest

from simbev_ros.cli.pool import worker_count

pytestmark = pytest.mark.usefixtures("no_graph")


@pytest.mark.parametrize("text", ["0", "-1", "x", "61", "٣", "", "1.5", "+3", " 3", "AUTO", "9" * 5000, "[/no]"])
@pytest.mark.parametrize("more", [(), ("--dry-run",)], ids=["make", "dry run"])
def test_a_bad_number_of_workers_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, text: str, more: tuple[str, ...]
) -> None:
    message = refused("generate", "demo", "--out", tmp_path / "set", f"--workers={text}", *more)
    assert message == f"error: --workers: is {text!r:.80}; allowed: 1 to 60, or auto\n"
    assert not (tmp_path / "set").exists()


def test_numbers_from_1_to_60_and_auto_are_allowed() -> None:
    assert [worker_count(text, 60) for text in (None, "auto", "1", "07", "60")] == [None, "auto", 1, 7, 60]
