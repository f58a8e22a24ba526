from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from analytic_maps import hilly_road

from simbev_ros.assets.land.plazas import plaza_arrays
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.region_pool import build_regions
from simbev_ros.assets.regions.region_scene import RegionScene
from simbev_ros.assets.regions.static_cache import StaticCache, load_static_scene, load_streetside
from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach, Region, regions_of
from simbev_ros.schema.scene.map_spec import MapSpec

SPEC = MapSpec(name="analytic", seed=0)
EAST, WEST = Region(0, 0), Region(-1, 0)


def as_bytes(scene: RegionScene | StaticScene) -> bytes:
    parts = [repr(scene.street_lights).encode()]
    if isinstance(scene, RegionScene):
        parts += [scene.obstacles.tobytes(), *(array.tobytes() for _, array in plaza_arrays(scene.plazas))]
    for tile in scene.tiles:
        parts += [tile.origin_m.tobytes(), bytes([tile.level])]
        for name, mesh in {"": tile.mesh, **tile.surfaces}.items():
            parts += [name.encode(), *(getattr(mesh, field.name).tobytes() for field in fields(Mesh))]
    return b"".join(parts)


@pytest.fixture(scope="module")
def network() -> RoadNetwork:
    return hilly_road()


@pytest.fixture(scope="module")
def cache_dir(network: RoadNetwork, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With both regions of the road's northern side in it."""
    folder = tmp_path_factory.mktemp("cache")
    for region in (WEST, EAST):
        StaticCache(SPEC, network, folder).region(region)
    return folder


def test_a_region_from_the_cache_has_the_bytes_of_one_built_alone_elsewhere(
    network: RoadNetwork, cache_dir: Path, tmp_path: Path
) -> None:
    built = StaticCache(SPEC, network, tmp_path).region(EAST)
    cache = StaticCache(SPEC, network, cache_dir)
    assert cache.missing([WEST, EAST, Region(0, -1)]) == (Region(0, -1),)
    assert as_bytes(cache.region(EAST)) == as_bytes(built)
    assert sum(len(tile.mesh.triangles) for tile in built.tiles) > 1000


def test_other_seeds_have_other_surroundings(network: RoadNetwork, cache_dir: Path) -> None:
    assert StaticCache(MapSpec(name="analytic", seed=1), network, cache_dir).missing([EAST]) == (EAST,)


def test_seasons_differ_in_plants_but_not_in_what_pedestrians_walk_around(
    network: RoadNetwork, cache_dir: Path
) -> None:
    winter = StaticCache(SPEC.model_copy(update={"season": "winter"}), network, cache_dir)
    summer = StaticCache(SPEC, network, cache_dir)
    assert winter.missing([EAST]) == (EAST,)
    bare, full = winter.region(EAST), summer.region(EAST)
    assert np.array_equal(bare.obstacles, full.obstacles)
    assert [tile.origin_m.tolist() for tile in bare.tiles] == [tile.origin_m.tolist() for tile in full.tiles]
    assert any((tile.mesh.material == Material.TWIG).any() for tile in bare.tiles)
    assert not any((tile.mesh.material == Material.TWIG).any() for tile in full.tiles)


@pytest.mark.parametrize("reach", [None, Reach((150.0, 100.0), 200.0)])
def test_street_lamps_carry_the_index_of_their_light(
    network: RoadNetwork, cache_dir: Path, reach: Reach | None
) -> None:
    scene = load_static_scene(SPEC, network, cache_dir, reach=reach)
    seen = set()
    for tile in scene.tiles:
        lamps = tile.mesh.material == Material.STREET_LAMP
        for index in np.unique(tile.mesh.uv[lamps, 0]).astype(int):
            own_m = tile.mesh.vertices[lamps & (tile.mesh.uv[:, 0] == index)] + tile.origin_m
            assert np.linalg.norm(own_m.mean(axis=0) - scene.street_lights[index].position_m) < 0.1
            seen.add(index)
    assert len(seen) > 5
    places_m = load_streetside(SPEC, network, cache_dir, reach=reach).light_m
    np.testing.assert_array_equal(places_m, [light.position_m for light in scene.street_lights])
    assert (len(seen) == len(scene.street_lights)) == (reach is None)


def test_a_damaged_file_is_built_again(network: RoadNetwork, cache_dir: Path) -> None:
    cache = StaticCache(SPEC, network, cache_dir)
    whole = as_bytes(cache.region(WEST))
    [path] = cache_dir.glob("surroundings/*/-1_0.npz")
    content = path.read_bytes()
    for damaged in (content[: len(content) // 2], b"", content[:1000] + b"\1" * 64 + content[1064:]):
        path.write_bytes(damaged)
        assert as_bytes(cache.region(WEST)) == whole
    assert path.read_bytes() == content


def test_a_cache_that_cannot_be_written_is_reported(network: RoadNetwork, tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(InputError, match=r"cache of surroundings .*cannot be written"):
        StaticCache(SPEC, network, blocker).region(EAST)


def test_one_process_at_a_time_builds_the_regions_of_a_map(network: RoadNetwork, tmp_path: Path) -> None:
    first, second = (StaticCache(SPEC, network, tmp_path) for _ in range(2))
    order = []

    def build_too() -> None:
        with second.building():
            order.append("second")

    with ThreadPoolExecutor(1) as thread:
        with first.building():
            done = thread.submit(build_too)
            with pytest.raises(TimeoutError):
                done.result(0.2)
            order.append("first")
        done.result(10.0)
    assert order == ["first", "second"]


def test_regions_of_different_maps_are_built_at_the_same_time(network: RoadNetwork, tmp_path: Path) -> None:
    other = MapSpec(name="other", seed=0)
    with StaticCache(SPEC, network, tmp_path).building(), StaticCache(other, network, tmp_path).building():
        pass


def test_a_lock_that_cannot_be_made_is_reported(network: RoadNetwork, tmp_path: Path) -> None:
    (tmp_path / "surroundings").write_text("")
    cache = StaticCache(SPEC, network, tmp_path)
    with pytest.raises(InputError, match=r"cache of surroundings .*cannot be written"), cache.building():
        pass


@pytest.mark.slow
def test_regions_built_in_parallel_are_those_built_one_by_one(tmp_path: Path) -> None:
    spec = MapSpec(name="Blocks", seed=0)
    network = load_network(spec, tmp_path)
    regions = regions_of(network.layout)[:2]
    done: list[None] = []
    build_regions(spec, regions, tmp_path, lambda: done.append(None))
    assert len(done) == 2
    assert StaticCache(spec, network, tmp_path).missing(regions) == ()
    alone = StaticCache(spec, network, tmp_path / "alone")
    assert as_bytes(StaticCache(spec, network, tmp_path).region(regions[1])) == as_bytes(alone.region(regions[1]))


def test_only_tiles_in_reach_are_loaded_and_land_goes_on_beyond_them(network: RoadNetwork, cache_dir: Path) -> None:
    reach = Reach((160.0, 160.0), 100.0)
    scene = load_static_scene(SPEC, network, cache_dir, reach=reach)
    squares = [tile.origin_m[:2] for tile in scene.tiles if np.abs(tile.mesh.vertices[:, :2]).max() < 200.0]
    near = [
        place for place in squares if np.hypot(*(np.clip([160.0, 160.0], place - 32.0, place + 32.0) - 160.0)) <= 100.0
    ]
    assert len(squares) == len(near) > 8
    bounds = np.array([tile.mesh.bounds_m + tile.origin_m for tile in scene.tiles])
    assert bounds[:, 0, :2].min() < -2000.0
    assert bounds[:, 1, :2].max() > 2500.0
