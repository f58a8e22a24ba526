"""Gaits of pedestrians and riders: walking, running, pedaling."""

import numpy as np
import pytest
from catalog_models import GAIT, ON_FOOT, PEDESTRIANS, blueprint, few_derived, model, pose_vertices, rows

from simbev_ros.assets.actors.shape import load_shape
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.gait import stride_lengths_m, transition_mps

RUNNERS = [entry.name for entry in PEDESTRIANS if entry.on_foot and not entry.runs_as]
LIMPING = [entry.name for entry in PEDESTRIANS if entry.fast]
EVEN = [name for name in ON_FOOT if name not in LIMPING]


@pytest.mark.parametrize("name", few_derived(ON_FOOT))
def test_strides_of_all_speeds_fill_the_box_of_a_pedestrian_to_a_centimeter(name: str) -> None:
    length, width, height = blueprint(name).size_m
    top = 2.0 if name in RUNNERS else 0.2 if name in LIMPING else 0.5
    speeds = np.sqrt(9.81 * blueprint(name).tall_m) * np.linspace(0.0, top, 7)
    points = [pose_vertices(model(name), rows(len(GAIT), gait=GAIT, vx=speed)) for speed in speeds]
    found = [np.min(points, axis=(0, 1, 2)), np.max(points, axis=(0, 1, 2))]
    expected = [[-length / 2, -width / 2, 0.0], [length / 2, width / 2, height]]
    np.testing.assert_allclose(found, expected, atol=0.01)


def walk_straight(name: str, speed_mps: float) -> tuple[Float64Array, Float64Array]:
    """Two strides of a pedestrian: (N,) distance covered, and (N, V, 3) vertices of the left foot, map frame."""
    stride_m = stride_lengths_m(blueprint(name).size_m[2], np.array([speed_mps]))[0]
    path_m = np.linspace(0.0, 2.0 * stride_m, 400)
    actors = rows(len(path_m), gait=path_m / stride_m * 2.0 * np.pi, vx=speed_mps)
    return path_m, pose_vertices(model(name), actors, "foot left") + path_m[:, None, None] * [1.0, 0.0, 0.0]


@pytest.mark.parametrize("name", ["pedestrian.heavy", "pedestrian.child", "pedestrian.runner_woman"])
@pytest.mark.parametrize("speed_mps", [0.8, 1.1, 1.5, 1.9, 2.6, 3.4, 4.6, 6.0, 8.0])
def test_a_foot_on_the_ground_neither_slides_nor_sinks(name: str, speed_mps: float) -> None:
    path_m, foot = walk_straight(name, speed_mps)
    lowest = foot[..., 2].argmin(axis=1)
    here = np.arange(len(path_m) - 1)
    height_m = foot[here, lowest[:-1], 2]
    assert height_m.min() > -0.006
    down = height_m < 0.001
    assert down.mean() > 0.15
    slip_m = foot[here + 1, lowest[:-1], 0] - foot[here, lowest[:-1], 0]
    assert np.abs(slip_m[down]).mean() < 0.05 * path_m[1]
    steps = np.split(np.where(down, slip_m, 0.0), np.flatnonzero(np.diff(down.astype(int)) == 1) + 1)
    assert max(abs(step.sum()) for step in steps) < 0.02


@pytest.mark.parametrize("name", few_derived(EVEN))
def test_walkers_always_have_a_foot_on_the_ground_and_runners_have_flight_phases(name: str) -> None:
    for speed_mps, min_share, max_share in ((1.3, 0.0, 0.0), (3.5, 0.1, 0.4), (6.0, 0.3, 0.6)):
        actors = rows(len(GAIT), gait=GAIT, vx=speed_mps)
        feet = [pose_vertices(model(name), actors, f"foot {side}") for side in ("left", "right")]
        points = np.concatenate(feet, axis=1)
        assert min_share <= np.mean(points[..., 2].min(axis=1) > 0.012) <= max_share


@pytest.mark.parametrize("height_m", [1.67, 1.8])
def test_step_rates_are_those_of_adults(height_m: float) -> None:
    speed_mps = np.array([0.8, 1.4, 2.0, 2.5, 4.0, 8.0])
    cadence_hz = 2.0 * speed_mps / stride_lengths_m(height_m, speed_mps)
    assert (cadence_hz > [1.2, 1.75, 2.1, 2.6, 2.8, 3.3]).all()
    assert (cadence_hz < [1.6, 2.1, 2.5, 3.0, 3.2, 4.0]).all()
    assert transition_mps(height_m) == pytest.approx(2.1, abs=0.1)
    assert transition_mps(1.3) == pytest.approx(1.84, abs=0.02)


@pytest.mark.parametrize("name", few_derived(EVEN))
@pytest.mark.parametrize("speed_mps", [1.4, 4.0])
def test_left_and_right_limbs_are_half_a_stride_apart_and_arms_oppose_legs(name: str, speed_mps: float) -> None:
    actors = rows(2, gait=[0.0, np.pi], vx=speed_mps)
    figure = load_shape(name).figure
    foot = {side: pose_vertices(model(name), actors, f"foot {side}").mean(axis=1)[:, 0] for side in ("left", "right")}
    arm = {side: pose_vertices(model(name), actors, f"forearm {side}").mean(axis=1)[:, 0] for side in ("left", "right")}
    np.testing.assert_allclose(foot["left"], foot["right"][::-1], atol=0.01)
    assert foot["left"][0] > foot["right"][0] + 0.2
    for side, sign, held in (("left", 1.0, figure.left_arm), ("right", -1.0, figure.right_arm)):
        swing_m = sign * (arm[side][1] - arm[side][0])
        assert abs(swing_m) < 1e-6 if held else swing_m > 0.05


@pytest.mark.parametrize("name", few_derived(ON_FOOT))
def test_a_standing_pedestrian_has_both_feet_under_the_body(name: str) -> None:
    points = {side: pose_vertices(model(name), rows(8, gait=GAIT[::6]), f"foot {side}") for side in ("left", "right")}
    for foot in points.values():
        np.testing.assert_allclose(foot, foot[:1].repeat(8, axis=0), atol=1e-9)
        assert abs(foot[0, :, 2].min()) < 0.001
    assert points["left"][0].mean(axis=0)[0] == pytest.approx(points["right"][0].mean(axis=0)[0], abs=0.01)


@pytest.mark.parametrize("name", ["bicycle", "city_bike", "road_bike", "mountain_bike", "cargo_bike"])
def test_a_cyclists_feet_follow_the_pedals(name: str) -> None:
    bicycle, rider = model(f"vehicle.{name}"), model(f"rider.{name}")
    actors = rows(len(GAIT), gait=GAIT)
    seat = np.array(blueprint(f"vehicle.{name}").rider_seat_m)
    for side, sign in (("left", 1.0), ("right", -1.0)):
        sole = pose_vertices(rider, actors, f"foot {side}") + seat
        cranks = pose_vertices(bicycle, actors, "cranks")
        pedal = cranks[:, sign * cranks[0, :, 1] > 0.1].mean(axis=1)
        assert np.linalg.norm(sole - pedal[:, None], axis=2).min(axis=1).max() < 0.08


def test_people_stand_with_their_arms_in_different_poses() -> None:
    bends = set()
    for name in ON_FOOT:
        figure = load_shape(name).figure
        standing, strolling = rows(1), rows(1, vx=1.3)
        for side in ("left", "right"):
            if not getattr(figure, f"{side}_arm"):
                still, moved = (
                    pose_vertices(model(name), actors, f"forearm {side}")[0] for actors in (standing, strolling)
                )
                assert np.abs(still - moved).max() > 0.01
                bends.add((still.mean(axis=0) / blueprint(name).tall_m).round(2).tobytes())
    assert len(bends) > 20
