"""Drivers who have waited for long stay impatient until they drive, not only until they move."""

from types import SimpleNamespace

import pytest

from simbev_ros.simulation.world.sumo import impatience
from simbev_ros.simulation.world.sumo.impatience import Impatience


class FakeSumo:
    """Vehicles v0, which waits, and v1, which is reckless; types have other names than vehicles."""

    def __init__(self) -> None:
        self.speed_mps = 0.0
        self.impatience = {"type v0": 0.0, "type v1": 1.0}
        self.present = ["v0", "v1"]
        self.vehicle = SimpleNamespace(
            getTypeID=lambda name: f"type {name}",
            getSpeed=lambda name: self.speed_mps,
            getIDList=lambda: tuple(self.present),
        )
        self.vehicletype = SimpleNamespace(getImpatience=self.impatience.__getitem__, setImpatience=self.set_impatience)

    def set_impatience(self, name: str, value: float) -> None:
        self.impatience[name] = value


@pytest.fixture
def sumo(monkeypatch: pytest.MonkeyPatch) -> FakeSumo:
    fake = FakeSumo()
    monkeypatch.setattr(impatience, "libsumo", fake)
    return fake


def test_impatience_grows_while_a_vehicle_waits_and_ends_when_it_drives(sumo: FakeSumo) -> None:
    drivers, seen = Impatience([0, 1]), []
    for second in range(26):
        sumo.speed_mps = 0.13 if second == 12 else 2.5 if second == 24 else 5.0 if second == 25 else 0.0
        drivers.update(1.0)
        seen.append(sumo.impatience["type v0"])
    assert seen == pytest.approx([*((second + 1) / 20.0 for second in range(20)), 1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    assert sumo.impatience["type v1"] == 1.0


def test_vehicles_that_have_left_sumo_are_left_alone(sumo: FakeSumo) -> None:
    drivers = Impatience([0, 1])
    sumo.present.remove("v0")
    drivers.update(1.0)
    assert sumo.impatience["type v0"] == 0.0
