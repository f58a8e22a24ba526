"""Farm tractors are traffic of country roads alone."""

import pytest

from simbev_ros.maps.build import load_network
from simbev_ros.maps.source import map_spec
from simbev_ros.scene.drawing.starts import StartPositions


@pytest.mark.parametrize("town, has_fields", [("Town02", False), ("Town07", True)])
def test_farm_tractors_start_on_slow_roads_between_fields(town: str, has_fields: bool) -> None:
    network = load_network(map_spec(town))
    starts = StartPositions(network, 24.0)
    usable = starts.usable(20.0)
    tractor, sedan = usable["vehicle.farm_tractor"], usable["vehicle.sedan"]
    assert tractor.any() == has_fields
    assert sedan.any()
    uses = network.features.uses_at(starts.vehicles.position_m[:, :2])
    lanes = [starts.vehicles.lanes[row] for row in starts.vehicles.row[tractor].tolist()]
    assert {*uses[tractor].tolist()} <= {"farmland"}
    assert all(lane.speed_mps < 100.0 / 3.6 for lane in lanes)
