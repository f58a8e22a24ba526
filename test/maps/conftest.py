"""Built-in towns shared by the tests of maps."""

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.parts import MapParts
from simbev_ros.maps.plan.town import build_town
from simbev_ros.maps.recipe import recipe_of
from simbev_ros.schema.scene.map_spec import MapSpec


@pytest.fixture(scope="session")
def map_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("map_cache")


@pytest.fixture(scope="session")
def blocks(map_cache: Path) -> RoadNetwork:
    return load_network(MapSpec(name="Blocks", seed=0), map_cache)


@pytest.fixture(scope="session")
def built_town(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], MapParts]:
    """Plans a built-in town with seed 0 and runs netconvert, once per session and town: the large ones take 20 s."""

    @cache
    def build(name: str) -> MapParts:
        return build_town(recipe_of(name), 0, tmp_path_factory.mktemp(name))

    return build
