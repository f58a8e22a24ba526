"""A graph that is not there, and configurations for it."""

import pytest
from fake_graph import FakeGraph, Scenarios

from simbev_ros.config.scenario import Scenario
from simbev_ros.production import scene_maker


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> FakeGraph:
    fake = FakeGraph()
    monkeypatch.setattr(scene_maker, "GraphSession", fake.session)
    monkeypatch.setattr(scene_maker, "build_surroundings", lambda *_: None)
    return fake


@pytest.fixture
def scenario() -> Scenarios:
    """A configuration of some scenes with next to nothing in them."""

    def make(scenes: int) -> Scenario:
        return Scenario.model_validate(
            {
                "scenes": [{"map": "Blocks", "train": scenes}],
                "rig": {"sensors": []},
                "time": {"duration_s": 0.1},
                "traffic": {"vehicles": 1, "pedestrians": 0, "spawn_radius_m": 100},
            }
        )

    return make
