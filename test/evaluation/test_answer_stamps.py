"""Stamps are assigned to ticks; other scenes are ignored, and stamps that belong to no tick are refused."""

import pytest
from evaluated_dataset import TICKS, spec

from simbev_ros.evaluation.live.answer_stamps import answered_tick
from simbev_ros.foundation.errors import InputError

SCENE = spec(1)
SCENES = {0, 1}


def test_stamps_of_frames_give_their_ticks() -> None:
    assert [answered_tick(SCENE.stamp_ns(tick), SCENE, SCENES) for tick in (0, TICKS - 1)] == [0, TICKS - 1]


def test_the_warm_up_and_earlier_scenes_are_ignored() -> None:
    for stamp_ns in (SCENE.stamp_ns(-1), SCENE.stamp_ns(0) - 1, spec(0).stamp_ns(3), spec(0).stamp_ns(-1) + 7):
        assert answered_tick(stamp_ns, SCENE, SCENES) is None


@pytest.mark.parametrize(
    ("stamp_ns", "nearest"),
    [
        (SCENE.stamp_ns(4) + 1, 4),
        (SCENE.stamp_ns(4) - 1, 4),
        (SCENE.stamp_ns(TICKS), TICKS - 1),
        (spec(2).stamp_ns(0), TICKS - 1),
        (0, 0),
        (1_763_800_000_123_456_789, TICKS - 1),
    ],
)
def test_a_stamp_that_belongs_to_no_tick_is_refused(stamp_ns: int, nearest: int) -> None:
    where = f"the nearest is {SCENE.stamp_ns(nearest)}, that of tick {nearest}"
    with pytest.raises(InputError, match=rf"^header.stamp: {stamp_ns} belongs to no tick of Blocks-0001; {where}$"):
        answered_tick(stamp_ns, SCENE, SCENES)
