"""People who sit: feet on the ground, thighs on the seat, within boxes that fit their meshes."""

import numpy as np
import open3d as o3d
import pytest
from catalog_models import PEDESTRIANS, blueprint, few_derived, model, rows

from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.actors.shape import load_shape
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.street.furniture import bench, bus_shelter
from simbev_ros.assets.street.rest_kinds import RestKind, rests_at_things
from simbev_ros.assets.street.small_things import small_thing
from simbev_ros.foundation.types import Float64Array

SEAT_M = 0.45
SITTING = [entry.name for entry in PEDESTRIANS if entry.sits]
TURNED = np.array([[0.0, -1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]])
THINGS = {"bench": bench(), "bus_shelter": bus_shelter(), "table": small_thing("table").transform(TURNED)}
THINGS["table_red"] = small_thing("table_red").transform(TURNED)


def part_points(name: str, part: str) -> Float64Array:
    """Vertices of a part."""
    of = model(name)
    return of.mesh.vertices[of.mesh.part == [entry.name for entry in of.parts].index(part)].astype(np.float64)


def ray_scene(mesh: Mesh) -> o3d.t.geometry.RaycastingScene:
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    return scene


def test_there_are_people_who_sit_for_every_weather() -> None:
    for weather in ("cold", "mild", "warm", "rain"):
        assert sum(blueprint(name).suits((weather,)) for name in SITTING) >= (3 if weather != "rain" else 2)
    assert not any(blueprint(name).frequency for name in SITTING)


@pytest.mark.parametrize("name", few_derived(SITTING))
def test_the_box_of_a_person_who_sits_is_the_extent_of_the_mesh_in_every_pose(name: str) -> None:
    length, width, height = blueprint(name).size_m
    actors = rows(2, blueprint=[0, 0], gait=[0.0, 2.0], vx=[0.0, 1.0])
    posed = pose_actors([model(name)], actors, np.zeros(3)).vertices.reshape(2, -1, 3)
    np.testing.assert_allclose(posed.min(axis=1), [[-length / 2, -width / 2, 0.0]] * 2, atol=1e-4)
    np.testing.assert_allclose(posed.max(axis=1), [[length / 2, width / 2, height]] * 2, atol=1e-4)


@pytest.mark.parametrize("name", few_derived(SITTING))
def test_both_feet_are_on_the_ground_and_the_thighs_on_the_seat(name: str) -> None:
    body_m = part_points(name, "body")
    assert SEAT_M - 0.01 < body_m[:, 2].min() < SEAT_M + 0.025
    for side in ("left", "right"):
        assert part_points(name, f"foot {side}")[:, 2].min() == pytest.approx(0.0, abs=0.002)
        thigh_m = part_points(name, f"thigh {side}")
        on_seat = thigh_m[:, 0] < thigh_m[:, 0].min() + 0.3
        assert SEAT_M - 0.04 < thigh_m[on_seat, 2].min() < SEAT_M + 0.005


@pytest.mark.parametrize("name", few_derived(SITTING))
def test_knees_are_bent_forward_by_a_usual_angle(name: str) -> None:
    pivots = {part.name: np.array(part.pivot_m) for part in model(name).parts}
    for side in ("left", "right"):
        thigh = pivots[f"shin {side}"] - pivots[f"thigh {side}"]
        shin = pivots[f"foot {side}"] - pivots[f"shin {side}"]
        bend_deg = np.degrees(np.arccos(thigh @ shin / np.linalg.norm(thigh) / np.linalg.norm(shin)))
        assert 50.0 < bend_deg < 110.0
        assert thigh[0] > 0.3 and shin[2] < -0.3


@pytest.mark.parametrize("thing", THINGS)
def test_seats_are_as_high_as_people_sit_and_free_in_front(thing: str) -> None:
    scene = ray_scene(THINGS[thing])
    for spot in rests_at_things()[thing.removesuffix("_red")]:
        if spot[4] <= RestKind.SHELTER_SEAT:
            ahead = np.array([np.cos(np.radians(spot[3])), np.sin(np.radians(spot[3])), 0.0])
            foot_m = spot[:3]
            above_m = foot_m + 0.2 * ahead + [0.0, 0.0, 1.2]
            ray = o3d.core.Tensor(np.array([[*above_m, 0.0, 0.0, -1.0]], np.float32))
            assert 1.2 - scene.cast_rays(ray)["t_hit"].numpy()[0] == pytest.approx(SEAT_M, abs=0.002)


@pytest.mark.parametrize("name", few_derived(SITTING))
@pytest.mark.parametrize("thing", THINGS)
def test_nobody_sinks_into_a_seat_or_its_back(thing: str, name: str) -> None:
    scene = ray_scene(THINGS[thing])
    spot = rests_at_things()[thing.removesuffix("_red")][0]
    yaw_rad = np.radians(spot[3])
    reach_m = blueprint(name).size_m[0] / 2.0
    actor = rows(1, x=spot[0] + reach_m * np.cos(yaw_rad), y=spot[1] + reach_m * np.sin(yaw_rad), z=spot[2])
    actor["yaw"] = yaw_rad
    points = o3d.core.Tensor(pose_actors([model(name)], actor, np.zeros(3)).vertices)
    inside = scene.compute_occupancy(points).numpy() > 0.5
    depth_m = scene.compute_distance(points).numpy()[inside]
    assert depth_m.max(initial=0.0) < 0.045


def test_some_people_sit_with_a_phone_and_some_with_their_arms_crossed() -> None:
    arms = {load_shape(name).figure.right_arm for name in SITTING}
    assert arms >= {"lap", "phone", "crossed", "knees"}
