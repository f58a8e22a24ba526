"""People who limp: unequal stances, feet and sticks that stay where they are on the ground."""

import numpy as np
import pytest
from catalog_models import PEDESTRIANS, blueprint, model, pose_vertices, rows

from simbev_ros.assets.actors.shape import load_shape
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import blueprint_named
from simbev_ros.scene.gait import stride_lengths_m

LIMPING = [entry.name for entry in PEDESTRIANS if entry.fast]
WITH_STICK = [name for name in LIMPING if load_shape(name).figure.stick]
SPEEDS_MPS = (0.6, 0.8)
PHASES = 512


def lowest_m(name: str, speed_mps: float, part: str, band_m: float = 10.0) -> tuple[Float64Array, Float64Array]:
    """(N,) height and (N,) position along the path of the lowest vertex of a part over one stride."""
    stride_m = stride_lengths_m(np.array([blueprint(name).tall_m]), np.array([speed_mps]))[0]
    share = np.arange(PHASES) / PHASES
    points = pose_vertices(model(name), rows(PHASES, gait=2.0 * np.pi * share, vx=speed_mps), part)
    row, lowest = np.arange(PHASES), points[..., 2].argmin(axis=1)
    return points[row, lowest, 2], points[row, lowest, 0] + share * stride_m


@pytest.mark.parametrize("name", LIMPING)
@pytest.mark.parametrize("speed_mps", SPEEDS_MPS)
def test_the_sore_leg_stands_for_a_shorter_time_than_the_other_one(name: str, speed_mps: float) -> None:
    share = {side: np.mean(lowest_m(name, speed_mps, f"foot {side}")[0] < 0.004) for side in ("left", "right")}
    assert 1.15 < share["right"] / share["left"] < 1.6
    assert share["left"] + share["right"] > 1.0


@pytest.mark.parametrize("name", LIMPING)
@pytest.mark.parametrize("speed_mps", SPEEDS_MPS)
def test_a_foot_is_always_on_the_ground_and_none_below_it(name: str, speed_mps: float) -> None:
    heights_m = np.stack([lowest_m(name, speed_mps, f"foot {side}")[0] for side in ("left", "right")])
    assert heights_m.min() > -0.008
    assert heights_m.min(axis=0).max() < 0.012


@pytest.mark.parametrize("name", WITH_STICK)
@pytest.mark.parametrize("speed_mps", SPEEDS_MPS)
def test_the_stick_stands_on_the_ground_while_the_sore_leg_does_and_does_not_slide(name: str, speed_mps: float) -> None:
    foot_m, _ = lowest_m(name, speed_mps, "foot left")
    height_m, at_m = lowest_m(name, speed_mps, "forearm right")
    stands = np.flatnonzero(foot_m < 0.002)
    stands = stands[(stands > 10) & (stands < 0.5 * PHASES)]
    assert np.abs(height_m[stands]).max() < 0.03
    assert np.ptp(at_m[stands]) < 0.08
    swings = np.arange(int(0.7 * PHASES), int(0.9 * PHASES))
    assert height_m[swings].min() > 0.008


@pytest.mark.parametrize("name", LIMPING)
def test_who_limps_and_is_fast_is_the_same_person_without_a_limp(name: str) -> None:
    words, fast = name.split("."), blueprint_named(blueprint(name).fast)
    assert fast.name.split(".")[1:3] == words[1:3]
    assert (fast.colors, fast.wear) == (blueprint(name).colors, blueprint(name).wear)
    assert not load_shape(fast.name).figure.limps
