"""Built-in towns shared by the tests of maps."""

from pathlib import Path

import pytest

from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.spec import MapSpec


@pytest.fixture(scope="session")
def map_cache(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("map_cache")


@pytest.fixture(scope="session")
def blocks(map_cache: Path) -> RoadNetwork:
    return load_network(MapSpec(name="Blocks", seed=0), map_cache)
