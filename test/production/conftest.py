"""A graph and a cluster that are not there, configurations for them, and the death of drivers."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from typing import Any

import obstore
import pytest
from bucket_content import DieAfter, Killed
from fake_graph import FakeGraph, Scenarios
from fake_ray import FakeRay, install_fake_ray

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.object_store import object_lock
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.production import scene_maker, surroundings
from simbev_ros.schema.scene.map_spec import MapSpec

_WRITES = ("put", "copy", "delete")


@cache
def _load_network_once(spec: MapSpec) -> RoadNetwork:
    return load_network(spec)


@pytest.fixture
def graph(monkeypatch: pytest.MonkeyPatch) -> FakeGraph:
    """A graph that is not there. Roads stay in memory for all tests, with what has been worked out from them."""
    fake = FakeGraph()
    monkeypatch.setattr(surroundings, "load_network", _load_network_once)
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


@pytest.fixture
def die_after(monkeypatch: pytest.MonkeyPatch) -> DieAfter:
    """Context in which this process writes into the store a number of times and is dead then; a minute passes after."""

    @contextmanager
    def arrange(writes: int) -> Iterator[None]:
        left = iter(range(writes))

        def counted(write: Callable[..., Any]) -> Callable[..., Any]:
            def call(*arguments: Any, **options: Any) -> Any:
                if next(left, None) is None:
                    raise Killed
                return write(*arguments, **options)

            return call

        monkeypatch.setattr(object_lock, "_EXPIRY_S", 0.0)
        with monkeypatch.context() as patch:
            for name in _WRITES:
                patch.setattr(obstore, name, counted(getattr(obstore, name)))
            yield

    return arrange


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster without nodes."""
    return install_fake_ray(monkeypatch)


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """The time, s, in a list of one."""
    now_s = [1000.0]
    monkeypatch.setattr(time, "monotonic", lambda: now_s[0])
    return now_s
