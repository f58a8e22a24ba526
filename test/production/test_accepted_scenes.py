"""Scenes that are drawn again until the rules of the configuration accept them."""

import pytest
from pydantic import ValidationError

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.production import drawing
from simbev_ros.production.drawing import draw_scenes
from simbev_ros.production.events import ProductionEvent, SceneRefused
from simbev_ros.production.observer import ProductionObserver
from simbev_ros.scene.drawing.draw_scene import SEEDS_PER_DRAW
from simbev_ros.simulation.world.rehearsal import SceneMotion


class _Refusals(ProductionObserver):
    def __init__(self) -> None:
        self.problems: list[tuple[str, ...]] = []

    def notify(self, event: ProductionEvent) -> None:
        if isinstance(event, SceneRefused):
            self.problems.append(event.problems)


def _scenario(**rules: object) -> Scenario:
    return Scenario.model_validate(
        {
            "seed": 7,
            "scenes": [{"map": "Blocks", "train": 1}],
            "rig": {"sensors": []},
            "time": {"warm_up_s": 1, "duration_s": 3},
            "traffic": {"vehicles": 4, "pedestrians": 4, "spawn_radius_m": 100},
            "hazards": {"count": 0},
            "accept": rules or None,
        }
    )


def test_a_scene_is_drawn_again_until_its_ego_drives_far_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    paths_m: list[float] = []
    rehearse = drawing.rehearse

    def noted(*arguments: object) -> SceneMotion:
        paths_m.append((motion := rehearse(*arguments)).path_m)  # type: ignore[arg-type]
        return motion

    monkeypatch.setattr(drawing, "rehearse", noted)
    refusals = _Refusals()
    (spec,) = draw_scenes(_scenario(min_path_m=16), refusals)
    assert len(paths_m) == len(refusals.problems) + 1 > 1
    assert paths_m[-1] >= 16 > max(paths_m[:-1])
    assert spec.seed == 7 + len(refusals.problems) * SEEDS_PER_DRAW
    assert draw_scenes(_scenario(min_path_m=16)) == [spec]
    (first,) = draw_scenes(_scenario())
    assert (first.seed, first.vehicles[0].start) != (spec.seed, spec.vehicles[0].start)


def test_rules_that_no_draw_meets_fail_with_what_was_wrong() -> None:
    with pytest.raises(
        InputError,
        match=r"^scene Blocks-0000: accept: none of 2 draws is accepted; .* [0-9.]+ m/s; min_mean_speed_mps is 90",
    ):
        draw_scenes(_scenario(min_mean_speed_mps=90, max_draws=2))


def test_a_section_without_a_rule_and_agents_driven_from_outside_are_refused() -> None:
    with pytest.raises(ValidationError, match="no rule is given; rules are min_path_m, "):
        _scenario(max_draws=3)
    with pytest.raises(ValidationError, match=r"accept: needs agents that traffic drives"):
        Scenario.model_validate({**_scenario(min_path_m=1).model_dump(), "ego": {"driver": "twist"}})
