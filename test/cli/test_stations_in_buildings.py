"""Commands that play scenes refuse a roadside unit in a building before any graph starts."""

from collections.abc import Callable
from pathlib import Path

import pytest
from stations_in_buildings import configuration_of, point_in_building_m


@pytest.mark.usefixtures("no_graph")
@pytest.mark.parametrize("command", ["run", "generate"])
def test_a_roadside_unit_in_a_building_is_refused_by_its_line(
    tmp_path: Path, refused: Callable[..., str], command: str
) -> None:
    x_m, y_m, _ = point_in_building_m("Blocks")
    config = configuration_of(tmp_path, "Blocks", f"x_m: {x_m}, y_m: {y_m}")
    options = ["--out", tmp_path / "dataset"] if command == "generate" else []
    message = refused(command, config, *options)
    assert "my.yaml:10: agents[0].mast.poses[0]: (" in message and "is inside a building of map Blocks" in message
