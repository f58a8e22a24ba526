"""Pictures from the street: of two places the one with something to see, and nothing right before the camera."""

from types import SimpleNamespace

import numpy as np

from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.primitives import Finish, box
from simbev_ros.assets.placement.static_scene import Tile
from simbev_ros.semantics import Tag
from simbev_ros.viz.street.viewpoint import find_viewpoint

_HOUSE = Finish(Material.FACADE, Tag.BUILDING, (200, 200, 200))


def place_among(*centers_m: tuple[float, float]) -> float:
    """The place chosen on a road along x (its x), of two that are 150 m apart, with houses around."""
    position_m = np.array([[0.0, 0.0, 0.0], [150.0, 0.0, 0.0]])
    waypoints = SimpleNamespace(position_m=position_m, yaw_rad=np.zeros(2))
    network = SimpleNamespace(waypoints=lambda spacing_m: waypoints)
    tiles = [Tile(np.array([x, y, 0.0]), box(_HOUSE, (10.0, 10.0, 12.0), (0.0, 0.0, 6.0)), {}) for x, y in centers_m]
    place_m, _ = find_viewpoint(network, tiles, np.array([75.0, 0.0]), 100.0)  # type: ignore[arg-type]
    return float(place_m[0])


def test_the_place_with_houses_along_the_street_is_chosen() -> None:
    houses = [(x, side * 14.0) for x in (180.0, 195.0, 210.0, 225.0) for side in (-1, 1)]
    assert place_among(*houses) == 150.0
    assert place_among(*((x - 150.0, y) for x, y in houses)) == 0.0


def test_a_place_before_a_wall_is_not_chosen() -> None:
    assert place_among((12.0, 0.0), (12.0, 10.0), (12.0, -10.0), (190.0, 16.0)) == 150.0
