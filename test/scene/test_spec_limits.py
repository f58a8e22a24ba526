"""A scene specification from elsewhere cannot ask for more than a configuration can."""

import pytest
from pydantic import ValidationError
from scene_edits import ego

from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather

PEDESTRIAN = {"blueprint": "a", "color": 0, "start": {"lane": "a", "s_m": 0}, "max_speed_mps": 1}
VEHICLE = {"blueprint": "a", "color": 0, "start": {"lane": "a", "s_m": 0}, "speed_factor": 1, "min_gap_m": 1}
SPEC = {
    "number": 0,
    "split": "train",
    "seed": 0,
    "map": {"name": "Blocks"},
    "agents": [ego()],
    "tick_ns": 50_000_000,
    "warm_up_ticks": 1,
    "ticks": 1,
    "weather": dict.fromkeys(Weather.model_fields, 1.0),
    "vehicles": [VEHICLE],
    "pedestrians": [PEDESTRIAN],
    "green_time_s": [9.0],
}


@pytest.mark.parametrize(
    "change",
    [
        {"ticks": 1 << 62},
        {"ticks": 3_000_001},
        {"warm_up_ticks": 1 << 62},
        {"tick_ns": 10**9 + 1},
        {"seed": 1 << 63},
        {"end_after_standing_ticks": 1 << 62},
        {
            "pedestrians": [{"blueprint": "a", "color": 0, "start": {"lane": "a", "s_m": 0}, "max_speed_mps": 1}]
            * 20_001
        },
    ],
    ids=lambda change: next(iter(change)),
)
def test_numbers_beyond_any_configuration_are_refused(change: dict[str, object]) -> None:
    SceneSpec.model_validate(SPEC)
    with pytest.raises(ValidationError):
        SceneSpec.model_validate(SPEC | change)
