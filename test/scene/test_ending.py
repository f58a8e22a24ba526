"""When and why a scene ends."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from simbev_ros.evaluation.driving.moment import Moment
from simbev_ros.scene.ending import DURATION, SceneEnd, SceneEndDetector
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, WorldState


def watch(standing_ticks: int | None, ticks: int = 100, reason: str = DURATION) -> SceneEndDetector:
    spec = SceneSpec.model_construct(
        number=4,
        map=SimpleNamespace(name="Blocks"),
        tick_ns=50_000_000,
        ticks=100,
        end_after_standing_ticks=standing_ticks,
    )
    return SceneEndDetector(spec, (ticks, reason))


def play(detector: SceneEndDetector, *speeds_mps: float, first_tick: int = 0) -> SceneEnd | None:
    """The end of the scene, which must not come before the last of these speeds; None if it does not come at all."""
    for tick, speed_mps in enumerate(speeds_mps, start=first_tick):
        ego = {"vx": 0.6 * speed_mps, "vy": 0.8 * speed_mps}
        state = SimpleNamespace(tick=tick, ego=ego, events=(SimpleNamespace(type="bump"),))
        end = detector.end_at(state)  # type: ignore[arg-type]
        assert end is None or tick == first_tick + len(speeds_mps) - 1
    return end


def test_a_scene_ends_when_the_ego_has_stood_still_long_enough_without_a_break() -> None:
    detector = watch(4)
    assert play(detector, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.05) is None
    end = play(detector, 0.0, first_tick=7)
    assert end == SceneEnd(scene="Blocks-0004", tick=7, reason="ego stood still for 0.2 s at tick 7", events=8)


def test_standing_in_the_warm_up_does_not_count() -> None:
    detector = watch(3)
    assert play(detector, *[0.0] * 10, first_tick=-8) is None
    assert play(detector, 0.0, first_tick=2) is not None


@pytest.mark.parametrize(("ticks", "reason"), [(100, DURATION), (30, "the replayed bag ends at tick 29")])
def test_without_a_limit_a_scene_ends_with_its_last_tick(ticks: int, reason: str) -> None:
    end = play(watch(None, ticks, reason), *[0.0] * ticks)
    assert end == SceneEnd(scene="Blocks-0004", tick=ticks - 1, reason=reason, events=ticks)


def test_the_speed_by_which_a_drive_ends_is_rounded_as_the_referee_rounds_it() -> None:
    ego = np.zeros((), ACTOR_DTYPE)
    ego["id"], ego["vx"], ego["vy"] = EGO_ID, 0.06, 0.08
    seen: list[float] = []
    detector = watch(None)
    detector._drive = SimpleNamespace(end_at=lambda *values: seen.append(values[2]))  # type: ignore[assignment]
    state = WorldState(0, 0, EGO_ID, ego[None], np.zeros(0), SimpleNamespace())  # type: ignore[arg-type]
    detector.end_at(state)
    assert seen == [Moment(state, 0.05, None, 0.0).speed_mps] != [math.hypot(ego["vx"], ego["vy"])]
