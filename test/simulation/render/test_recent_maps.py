"""Maps for agents that take turns: each finds its own, and maps are reused in the order of their last use."""

import pytest

from simbev_ros.simulation.render.lighting.recent_maps import RecentMaps


def maps_for(agents: int) -> RecentMaps[str, object]:
    maps: RecentMaps[str, object] = RecentMaps(object)
    maps.max_count = agents
    return maps


def test_a_map_is_found_again_by_its_key() -> None:
    maps = maps_for(2)
    (a, drawn_a), (b, drawn_b) = maps.find("a"), maps.find("b")
    assert a is not b and drawn_a is None and drawn_b is None
    assert maps.find("a") == (a, "a") and maps.find("b") == (b, "b")


def test_agents_in_turns_that_move_reuse_their_own_maps() -> None:
    maps = maps_for(2)
    first, second = maps.find("a0")[0], maps.find("b0")[0]
    for step in range(1, 4):
        assert maps.find(f"a{step}") == (first, f"a{step - 1}")
        assert maps.find(f"b{step}") == (second, f"b{step - 1}")


def test_the_least_recently_used_map_is_reused() -> None:
    maps = maps_for(2)
    a, b = maps.find("a")[0], maps.find("b")[0]
    maps.find("a")
    assert maps.find("c") == (b, "b")
    assert maps.find("d") == (a, "a")


@pytest.mark.parametrize("agents", [0, 1])
def test_there_is_one_map_at_least(agents: int) -> None:
    maps = maps_for(agents)
    a = maps.find("a")[0]
    assert maps.find("b") == (a, "a")


def test_maps_remain_when_there_are_fewer_agents() -> None:
    maps = maps_for(2)
    a, b = maps.find("a")[0], maps.find("b")[0]
    maps.max_count = 1
    assert maps.find("a") == (a, "a") and maps.find("c") == (b, "b") and maps.find("a") == (a, "a")
