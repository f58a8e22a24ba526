"""Roadside units at poses inside buildings are refused, with the line of the pose."""

from pathlib import Path

import numpy as np
import pytest
from stations_in_buildings import configuration_of, point_in_building_m

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.semantics import Tag
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.free_stations import is_below_building, require_free_stations

ROOF = np.array([[[0.0, 0.0, 4.0], [4.0, 0.0, 4.0], [0.0, 4.0, 8.0]]])
"""A roof that rises from 4 m in the south to 8 m in the north."""
WALL = np.array([[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [4.0, 0.0, 4.0]]])


def mesh_of(corners: np.ndarray, tag: Tag = Tag.BUILDING) -> Mesh:
    return Mesh.flat(corners, material=Material.PLAIN, tag=tag, color=(9, 9, 9))


@pytest.mark.parametrize("order", [[0, 1, 2], [2, 1, 0]])
@pytest.mark.parametrize(
    ("point_m", "is_below"),
    [((1, 1, 0), True), ((1, 1, 4.9), True), ((1, 1, 5.1), False), ((1, 2.5, 6.4), True), ((3, 3, 0), False)],
)
def test_a_point_is_in_a_building_if_a_roof_is_above_it(
    point_m: tuple[float, float, float], is_below: bool, order: list[int]
) -> None:
    assert is_below_building(np.array(point_m, float), mesh_of(ROOF[:, order])) == is_below


def test_neither_walls_nor_trees_make_a_building() -> None:
    point_m = np.array([2.0, 0.0, 1.0])
    assert not is_below_building(point_m, mesh_of(WALL))
    assert not is_below_building(point_m, mesh_of(ROOF, Tag.VEGETATION))
    assert not is_below_building(point_m, Mesh.empty())


@pytest.mark.parametrize("town", ["Blocks", pytest.param("Town05", marks=pytest.mark.slow)])
def test_a_unit_in_a_building_is_refused_by_its_line_and_one_on_the_roof_is_not(tmp_path: Path, town: str) -> None:
    x_m, y_m, top_m = point_in_building_m(town)
    scenario = load_scenario(configuration_of(tmp_path, town, f"x_m: {x_m}, y_m: {y_m}"))
    message = rf"my.yaml:10: agents\[0\].mast.poses\[0\]: \(.*\) is inside a building of map {town}"
    with pytest.raises(InputError, match=message):
        require_free_stations(scenario, draw_scenes(scenario))
    on_roof = load_scenario(configuration_of(tmp_path, town, f"x_m: {x_m}, y_m: {y_m}, z_m: {top_m}"))
    require_free_stations(on_roof, draw_scenes(on_roof))
