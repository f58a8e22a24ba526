"""OpenSCENARIO files that cannot be played: exit code 2 and one message, before any process starts."""

from collections.abc import Callable
from pathlib import Path

import pytest

pytestmark = pytest.mark.usefixtures("no_graph")

EXAMPLE = (Path(__file__).parents[2] / "examples/cut_in.xosc").read_text()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (EXAMPLE, "no XML", "bad.xosc"),
        ("</OpenSCENARIO>", "", "bad.xosc"),
        ("<TeleportAction>", "<TeleportActions>", "bad.xosc"),
        ('filepath="Blocks"', 'filepath="gone.xodr"', "bad.xosc:10: no such file: "),
        ('filepath="Blocks"', 'filepath=""', "bad.xosc: names no road network; name one: scenes: "),
        ('entityRef="Van" value="1"', 'entityRef="Lorry" value="1"', "Lorry"),
        ('roadId="244"', 'roadId="999"', "LanePosition: there is no road 999"),
        ('vehicleCategory="van"', 'vehicleCategory="boat"', "'boat'"),
    ],
)
def test_a_bad_scenario(refused: Callable[..., str], tmp_path: Path, before: str, after: str, message: str) -> None:
    assert before in EXAMPLE
    (tmp_path / "bad.xosc").write_text(EXAMPLE.replace(before, after))
    error = refused("run", tmp_path / "bad.xosc", "--record", tmp_path / "out")
    assert message in error
    assert not (tmp_path / "out").exists()


def test_a_scenario_that_is_missing(refused: Callable[..., str], tmp_path: Path) -> None:
    (tmp_path / "my.yaml").write_text("scenarios: [gone.xosc]\nrig: {sensors: [{type: imu, name: imu}]}\n")
    assert "my.yaml:1: scenarios[0]: no such file: " in refused("run", tmp_path / "my.yaml")
