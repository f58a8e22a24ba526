"""Tests of viewpoints: the position with something to see and nothing right in front of the camera is chosen."""

from types import SimpleNamespace

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.foundation.semantics import Tag
from simbev_ros.show.street.viewpoint import find_viewpoint

_HOUSE = Finish(Material.FACADE, Tag.BUILDING, (200, 200, 200))


def chosen_x_m(*centers_m: tuple[float, float]) -> float:
    """The x of the position chosen on a road along x, of two that are 150 m apart, with houses around."""
    position_m = np.array([[0.0, 0.0, 0.0], [150.0, 0.0, 0.0]])
    waypoints = SimpleNamespace(position_m=position_m, yaw_rad=np.zeros(2))
    network = SimpleNamespace(waypoints=lambda spacing_m: waypoints)
    tiles = [Tile(np.array([x, y, 0.0]), box(_HOUSE, (10.0, 10.0, 12.0), (0.0, 0.0, 6.0)), {}) for x, y in centers_m]
    viewpoint_m, _ = find_viewpoint(network, tiles, np.array([75.0, 0.0]), 100.0)  # type: ignore[arg-type]
    return float(viewpoint_m[0])


def test_the_position_with_houses_along_the_street_is_chosen() -> None:
    houses = [(x, side * 14.0) for x in (180.0, 195.0, 210.0, 225.0) for side in (-1, 1)]
    assert chosen_x_m(*houses) == 150.0
    assert chosen_x_m(*((x - 150.0, y) for x, y in houses)) == 0.0


def test_a_position_in_front_of_a_wall_is_not_chosen() -> None:
    assert chosen_x_m((12.0, 0.0), (12.0, 10.0), (12.0, -10.0), (190.0, 16.0)) == 150.0
