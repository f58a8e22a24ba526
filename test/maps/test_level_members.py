import numpy as np
import pytest
from road_strips import layout_of_strips, level_ground, straight

from simbev_ros.foundation.types import Float64Array
from simbev_ros.maps.roads.layout import Layout
from simbev_ros.maps.roads.level_members import LevelGraph
from simbev_ros.maps.roads.levels import assign_levels


def _arched(xy_m: Float64Array) -> Float64Array:
    """Heights of a road that rises to 7 m at the origin over 100 m, and falls again."""
    return np.asarray(np.maximum(7.0 - 0.07 * np.abs(xy_m[:, 0]), 0.0))


@pytest.fixture(scope="module")
def crossing() -> Layout:
    under = straight("under", (0, -140), (0, 140), level_ground)
    over = straight("over", (-140, 0), (140, 0), _arched)
    joint = straight("joint", (-141, 0.0), (-141, 140.0), level_ground)  # the path from one road to the other
    joint_2 = straight("joint_2", (-142, 140.0), (2, 140.0), level_ground)
    return assign_levels(layout_of_strips(under, over, joint, joint_2))


_UNDER, _DECK, _RAMP = [0.0, 0.0, 0.0], [0.0, 0.0, 7.0], [-70.0, 0.0, 2.1]
_BESIDE = [0.0, 60.0, 0.0]


def test_deck_above_does_not_belong_to_an_ego_on_the_ground(crossing: Layout) -> None:
    graph = LevelGraph(crossing)
    members = graph.members(np.array(_UNDER))
    assert members is not None
    assert members.holds(np.array([_UNDER, _BESIDE, _RAMP, _DECK])).tolist() == [True, True, True, False]
    assert members.belongs.tolist() == (graph.level[members.piece] == 0).tolist()


def test_road_beneath_does_not_belong_to_an_ego_on_the_deck(crossing: Layout) -> None:
    members = LevelGraph(crossing).members(np.array(_DECK))
    assert members is not None
    assert members.holds(np.array([_UNDER, _BESIDE, _RAMP, _DECK])).tolist() == [False, False, True, True]


def test_bridge_ahead_on_the_egos_road_belongs_and_the_road_below_it_does_not(crossing: Layout) -> None:
    members = LevelGraph(crossing).members(np.array(_RAMP))
    assert members is not None
    assert members.holds(np.array([_DECK, _RAMP, _UNDER, _BESIDE])).tolist() == [True, True, False, True]


def test_without_nearby_structures_there_are_no_level_members(crossing: Layout) -> None:
    assert LevelGraph(layout_of_strips(straight("a", (0, 0), (9, 0), level_ground))).members(np.zeros(3)) is None
    assert LevelGraph(crossing).members(np.array([500.0, 0.0, 0.0])) is None
