import numpy as np
import pytest
from analytic_maps import crossing, hilly_road, level_street, river

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.land.relief import Relief
from simbev_ros.maps.land.terrain import Terrain
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.roads.elevation import Elevation

BEND_M = 0.01  # deviation of the road between nodes 2 m apart


def along(network: RoadNetwork, level: int) -> Float64Array:
    """Positions on lanes of a level, including their borders."""
    strips = [strip for strip in network.layout.strips if strip.level == level]
    return np.concatenate([line[:, :2] for strip in strips for line in (strip.left_m, strip.center_m, strip.right_m)])


def test_land_lies_in_the_plane_of_the_roads_on_the_ground() -> None:
    network = hilly_road()
    positions_m = along(network, 0)
    roads_m = Elevation(network.layout).height_m(positions_m)
    np.testing.assert_allclose(Terrain(network).height_m(positions_m), roads_m, atol=BEND_M)


def test_far_from_roads_land_is_the_relief() -> None:
    network = hilly_road()
    positions_m = np.array([[-400.0, 700.0], [0.0, -600.0], [900.0, 30.0]])
    expected_m = Relief.of(network.features.relief, network.seed).height_m(positions_m)
    np.testing.assert_allclose(Terrain(network).height_m(positions_m), expected_m, atol=0.01)


def test_land_passes_below_a_bridge_and_stays_below_its_deck() -> None:
    network = crossing()
    terrain = Terrain(network)
    deck_m = along(network, 1)
    deck_m = deck_m[np.abs(deck_m[:, 0] - 256.0) < 18.0]
    assert (terrain.elevation.height_m(deck_m, 1) - terrain.height_m(deck_m) > 1.3).all()
    np.testing.assert_allclose(terrain.height_m(np.array([[256.0, 256.0]])), 0.0, atol=BEND_M)


@pytest.mark.parametrize("build", [hilly_road, crossing, river])
def test_land_has_no_cliffs(build: type) -> None:
    network = build()
    values_m = Terrain(network).patch(np.array([0.0, 0.0]), np.array([512.0, 512.0])).heights.values
    deck_m = np.array([[[x, y] for y in np.arange(0.0, 513.0, 2.0)] for x in np.arange(0.0, 513.0, 2.0)])
    clear = np.full(values_m.shape, True)
    for strip in network.layout.strips:
        if strip.level > 0:
            low, high = strip.left_m[:, :2].min(axis=0) - 12.0, strip.left_m[:, :2].max(axis=0) + 12.0
            clear &= ~((deck_m >= low) & (deck_m <= high)).all(axis=2)
    for axis in (0, 1):
        steps = np.abs(np.diff(values_m, axis=axis)) / 2.0
        inner = clear[1:] & clear[:-1] if axis == 0 else clear[:, 1:] & clear[:, :-1]
        assert steps[inner].max() < 0.75


def test_water_has_a_bed_below_its_surface_and_banks_above_it() -> None:
    network = river()
    water = network.features.water[0]
    terrain = Terrain(network)
    y = np.arange(40.0, 480.0, 7.0)
    middle_m = np.column_stack([256.0 + 20.0 * np.sin(y / 60.0), y])
    middle_m = middle_m[np.abs(y - 256.0) > 30.0]
    assert (terrain.height_m(middle_m) < water.surface_m - 2.0).all()
    for side_m in (-24.0, 24.0):
        assert (terrain.height_m(middle_m + np.array([side_m, 0.0])) > water.surface_m + 0.1).all()


def test_patches_that_overlap_agree_to_the_bit() -> None:
    terrain = Terrain(hilly_road())
    west = terrain.patch(np.array([-128.0, -64.0]), np.array([64.0, 128.0])).heights.values
    east = terrain.patch(np.array([0.0, -64.0]), np.array([192.0, 128.0])).heights.values
    assert (west[64:] == east[:33]).all()
    assert np.ptp(west[64:]) > 1.0


def test_a_flat_map_has_flat_terrain() -> None:
    terrain = Terrain(level_street())
    assert terrain.is_level
    assert (terrain.height_m(np.array([[5.0, 7.0], [-900.0, 3000.0]])) == 0.0).all()
