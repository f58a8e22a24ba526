"""An object built from a static scene is kept while scenes stay in one region, and released afterward."""

from typing import Any

import pytest
from made_up_scene import made_up_spec

from simbev_ros.maps.roads.tunnels import Tunnels
from simbev_ros.ros.nodes import surroundings
from simbev_ros.ros.nodes.surroundings import Surroundings

SPEC = made_up_spec([{"type": "gnss", "name": "gnss"}])


class FakeScene:
    """A static scene that can be weakly referenced."""

    tunnels = Tunnels.none()


@pytest.fixture
def loaded(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    """Reaches for which a static scene was loaded; the reach of a scene is its view distance."""
    reaches: list[Any] = []

    def load(*_: object, reach: object) -> FakeScene:
        reaches.append(reach)
        return FakeScene()

    monkeypatch.setattr(surroundings, "load_network", lambda *_: None)
    monkeypatch.setattr(surroundings, "loaded_reach", lambda _spec, _network, view_m: view_m)
    monkeypatch.setattr(surroundings, "load_static_scene", load)
    return reaches


def test_what_was_built_is_kept_until_another_region_is_needed(loaded: list[Any]) -> None:
    released: list[Any] = []
    kept: Surroundings[Any] = Surroundings(lambda static: [static], released.append)
    first = kept.load(SPEC, 10.0)
    assert kept.load(SPEC, 10.0) is first is kept.built
    assert released == []
    second = kept.load(SPEC, 20.0)
    assert second is kept.built is not first
    assert (loaded, released) == ([10.0, 20.0], [first])
    kept.close()
    kept.close()
    assert released == [first, second]


def test_nodes_of_a_process_share_a_static_scene(loaded: list[Any]) -> None:
    one: Surroundings[Any] = Surroundings(lambda static: [static])
    other: Surroundings[Any] = Surroundings(lambda static: [static])
    assert one.load(SPEC, 30.0)[0] is other.load(SPEC, 30.0)[0]
    assert loaded == [30.0]


def test_without_a_scene_nothing_is_built() -> None:
    with pytest.raises(AssertionError, match="no scene has been loaded"):
        _ = Surroundings(lambda static: static).built
