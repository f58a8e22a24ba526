from dataclasses import fields, replace

import numpy as np
import open3d as o3d
import pytest
from catalog_models import ON_FOOT, PEDESTRIANS, blueprint, few_derived, model, pose_vertices, rows

from simbev_ros.assets.actors.actor_model import ActorModel, Cycle
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.finishes import finish_named
from simbev_ros.assets.actors.shape import Shape, build_model, load_shape
from simbev_ros.assets.actors.skeletons import part_poses
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.foundation.semantics import BOX_CLASSES, Tag
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.blueprints import load_blueprints

NAMES = [blueprint.name for blueprint in load_blueprints()]
VEHICLES = [blueprint.name for blueprint in load_blueprints() if blueprint.kind == "vehicle"]
TRAILERS = [blueprint.name for blueprint in load_blueprints() if blueprint.kind == "trailer"]
FOUR_WHEELED = [entry.name for entry in load_blueprints() if entry.kind == "vehicle" and not entry.rider]
WITH_TAILS = [
    entry.name for entry in load_blueprints() if entry.kind == "vehicle" and entry.name != "vehicle.articulated_bus"
]
WITH_DOORS = [entry.name for entry in load_blueprints() if entry.doors]
PROPS = [entry.name for entry in load_blueprints() if entry.kind == "prop"]
EMERGENCY = [blueprint.name for blueprint in load_blueprints() if blueprint.emergency]
DARK = [channel for name in ("lining", "seat", "glass", "black") for channel in finish_named(name, Tag.CAR).color]


def test_there_is_a_model_for_every_blueprint_at_its_index() -> None:
    assert [entry.blueprint for entry in load_models()] == NAMES
    assert [entry.tag for entry in load_models()] == [entry.tag for entry in load_blueprints()]


@pytest.mark.parametrize("name", few_derived([name for name in NAMES if name not in ON_FOOT]))
def test_the_mesh_fills_its_box_to_a_millimeter(name: str) -> None:
    length, width, height = blueprint(name).size_m
    expected = [[-length / 2, -width / 2, 0.0], [length / 2, width / 2, height]]
    np.testing.assert_allclose(model(name).mesh.bounds_m, expected, atol=1e-3)


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_the_three_corners_of_a_triangle_share_their_attributes(name: str) -> None:
    mesh = model(name).mesh
    for attribute in (mesh.material, mesh.tag, mesh.part, mesh.color):
        corners = attribute[mesh.triangles]
        assert (corners == corners[:, :1]).all()
    assert set(mesh.tag.tolist()) == {int(blueprint(name).tag)}
    assert np.isfinite(mesh.uv).all()


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_normals_are_unit_and_agree_with_the_winding(name: str) -> None:
    mesh = model(name).mesh
    corners = mesh.vertices[mesh.triangles].astype(np.float64)
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.linalg.norm(face, axis=1, keepdims=True)
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-4)
    assert np.einsum("ti,tki->tk", face, mesh.normals[mesh.triangles]).min() > 0.2


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_no_back_of_a_triangle_is_seen_from_outside(name: str) -> None:
    mesh = model(name).mesh
    rays_at = np.random.default_rng(7)
    directions = rays_at.normal(size=(20_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    low, high = mesh.bounds_m
    origins = rays_at.uniform(low, high, (len(directions), 3)) - 30.0 * directions
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(mesh.vertices), o3d.core.Tensor(mesh.triangles.astype(np.uint32)))
    hits = scene.cast_rays(o3d.core.Tensor(np.concatenate([origins, directions], axis=1).astype(np.float32)))
    hit = np.isfinite(hits["t_hit"].numpy())
    front = np.einsum("ij,ij->i", hits["primitive_normals"].numpy()[hit], directions[hit]) < 0.0
    assert hit.sum() > 1000
    assert front.mean() > 0.998


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_parts_come_after_their_parents_and_none_is_empty(name: str) -> None:
    parts = model(name).parts
    assert parts[0].parent == -1
    assert all(-1 <= part.parent < index for index, part in enumerate(parts))
    used = set(model(name).mesh.part.tolist())
    assert used <= set(range(len(parts)))
    assert {index for index, part in enumerate(parts) if part.spins or part.cranks} <= used
    assert len({part.name for part in parts}) == len(parts)


@pytest.mark.parametrize("name", few_derived(NAMES))
def test_triangles_are_within_the_budget(name: str) -> None:
    budgets = {
        "pedestrian": (1000, 3500),
        "rider": (1000, 3500),
        "vehicle": (1000, 8000),
        "trailer": (500, 8000),
        "prop": (200, 600),
    }
    own = {"pedestrian.wheelchair": (1000, 4500), "prop.worker": (1000, 3000)}
    min_count, max_count = own.get(name, budgets[blueprint(name).kind])
    assert min_count < len(model(name).mesh.triangles) < max_count


@pytest.mark.parametrize("name", few_derived([*VEHICLES, *TRAILERS]))
def test_wheels_have_the_radius_of_the_blueprint_and_touch_the_ground_however_they_turn(name: str) -> None:
    of, radius_m = model(name), blueprint(name).wheel_radius_m
    actors = rows(8, wheel=np.linspace(0.0, 2.0, 8))
    for part in (part for part in of.parts if part.spins):
        points = pose_vertices(of, actors, part.name)
        center = np.asarray(part.pivot_m)
        reach = np.hypot(points[..., 0] - center[0], points[..., 2] - center[2]).max(axis=1)
        np.testing.assert_allclose(reach, radius_m / part.spins, rtol=0.015)  # all roll the same distance
        np.testing.assert_allclose(points[..., 2].min(axis=1), 0.0, atol=0.03 * radius_m)
        displacement_m = np.abs(points[1:] - points[:1]).max()
        assert displacement_m > radius_m


@pytest.mark.parametrize("name", few_derived(VEHICLES))
def test_only_the_front_wheels_steer_and_the_axles_are_the_wheelbase_apart(name: str) -> None:
    of = model(name)
    straight, left = part_poses(of, rows(2, steer=[0.0, 0.3]))
    wheels = [(index, part.pivot_m[0]) for index, part in enumerate(of.parts) if part.spins]
    front_x, rear_x = max(x for _, x in wheels), min(x for _, x in wheels)
    assert front_x - rear_x == pytest.approx(blueprint(name).wheelbase_m, abs=0.03)
    for index, x in wheels:
        heading = left[index, :3, :3] @ straight[index, :3, :3].T @ [1.0, 0.0, 0.0]
        assert np.arctan2(heading[1], heading[0]) == pytest.approx(0.3 if x == front_x else 0.0, abs=1e-6)


@pytest.mark.parametrize("name", few_derived(TRAILERS))
def test_a_trailer_has_its_coupling_in_front_its_lamps_behind_and_axles_that_do_not_steer(name: str) -> None:
    of, (length_m, _, _) = model(name), blueprint(name).size_m
    axles_m = {part.pivot_m[0] for part in of.parts if part.spins}
    assert np.mean(list(axles_m)) == pytest.approx(-blueprint(name).axle_m, abs=0.02)
    assert np.ptp(list(axles_m)) == pytest.approx(blueprint(name).wheelbase_m, abs=0.03)
    assert not any(part.steers for part in of.parts)
    assert 0.2 * length_m < blueprint(name).hitch_m < 0.5 * length_m
    tail = (
        Material.LAMP_TAIL,
        Material.LAMP_TURN_LEFT,
        Material.LAMP_TURN_RIGHT,
        Material.LAMP_REVERSE,
        Material.PLATE,
    )
    assert all(len(lamp_points(name, each)) for each in tail)
    assert max(lamp_points(name, each)[:, 0].max() for each in tail) < -0.3 * length_m
    assert not len(lamp_points(name, Material.LAMP_LOW_BEAM))


def test_wheels_roll_forward() -> None:
    top = np.array([0.0, 0.0, 0.33]) + model("vehicle.sedan").parts[1].pivot_m
    pose = part_poses(model("vehicle.sedan"), rows(1, wheel=0.1))[0, 1]
    assert (pose[:3, :3] @ top + pose[:3, 3])[0] > top[0] + 0.02


def test_the_smaller_front_wheels_of_a_tractor_cover_the_distance_of_the_large_ones() -> None:
    of, wheel_rad = model("vehicle.farm_tractor"), 0.1
    pose = part_poses(of, rows(1, wheel=wheel_rad))[0]
    for index, part in enumerate(of.parts):
        if part.spins:
            turn_rad = np.arctan2(pose[index, 0, 2], pose[index, 0, 0])
            assert turn_rad * part.pivot_m[2] == pytest.approx(wheel_rad * 0.86, rel=0.01)


def lamp_points(name: str, material: Material) -> Float64Array:
    mesh = model(name).mesh
    return mesh.vertices[mesh.material == material].astype(np.float64)


@pytest.mark.parametrize("name", few_derived(WITH_TAILS))
def test_head_lamps_are_in_front_and_tail_lamps_behind(name: str) -> None:
    length_m = blueprint(name).size_m[0]
    assert lamp_points(name, Material.LAMP_LOW_BEAM)[:, 0].min() > 0.2 * length_m
    assert lamp_points(name, Material.LAMP_TAIL)[:, 0].max() < -0.3 * length_m


@pytest.mark.parametrize("name", few_derived([name for name in WITH_TAILS if blueprint(name).tag != Tag.BICYCLE]))
def test_blinkers_are_at_all_four_corners_and_plates_behind(name: str) -> None:
    for material, side in ((Material.LAMP_TURN_LEFT, 1.0), (Material.LAMP_TURN_RIGHT, -1.0)):
        points = lamp_points(name, material)
        assert (points[:, 1] * side > 0.0).all()
        assert points[:, 0].max() > 0.2 * blueprint(name).size_m[0]
        assert points[:, 0].min() < -0.3 * blueprint(name).size_m[0]
    assert lamp_points(name, Material.PLATE)[:, 0].min() < -0.4 * blueprint(name).size_m[0]


@pytest.mark.parametrize("name", few_derived([name for name in FOUR_WHEELED if name in WITH_TAILS]))
def test_cars_have_reversing_lamps_and_glass_on_all_sides(name: str) -> None:
    assert lamp_points(name, Material.LAMP_REVERSE)[:, 0].max() < -0.3 * blueprint(name).size_m[0]
    glass = lamp_points(name, Material.GLASS)
    assert glass[:, 0].max() > 0.0
    assert glass[:, 1].max() > 0.5
    assert glass[:, 1].min() < -0.5


def test_there_are_models_of_every_kind() -> None:
    cars = [entry for entry in load_blueprints() if entry.tag == Tag.CAR and not entry.emergency]
    assert len({entry.size_m for entry in cars}) >= 12
    tags = [entry.tag for entry in load_blueprints()]
    assert tags.count(Tag.TRUCK) >= 5
    assert tags.count(Tag.BUS) >= 2
    assert tags.count(Tag.MOTORCYCLE) >= 5
    assert tags.count(Tag.BICYCLE) >= 6
    assert len(PEDESTRIANS) > 90
    assert any(entry.wheelchair for entry in PEDESTRIANS)


@pytest.mark.parametrize("name", few_derived(VEHICLES))
def test_doors_of_the_blueprint_are_parts_of_the_model_in_the_order_of_their_bits(name: str) -> None:
    names = ["door front left", "door front right", "door rear left", "door rear right"]
    doors = [part for part in model(name).parts if part.name.startswith("door")]
    assert [part.name for part in doors] == names[: blueprint(name).doors]
    assert [part.door for part in doors] == list(range(len(doors)))


@pytest.mark.parametrize("name", few_derived(WITH_DOORS))
def test_a_door_opens_outward_about_its_front_edge_and_moves_nothing_else(name: str) -> None:
    of, count = model(name), blueprint(name).doors
    shut, every, *single = pose_vertices(of, rows(count + 2, doors=[0, 15, *(1 << k for k in range(count))]))
    for k, opened in enumerate(single):
        index = next(index for index, part in enumerate(of.parts) if part.door == k and part.opening_rad)
        moves = of.mesh.part == index
        np.testing.assert_array_equal(opened[~moves], shut[~moves])
        np.testing.assert_array_equal(opened[moves], every[moves])
        side = 1.0 if k % 2 == 0 else -1.0
        outward_m = (opened - shut)[moves, 1] * side
        assert outward_m.max() > 0.5
        assert outward_m.min() > -0.15
        tip = np.argmin(shut[moves, 0])
        arm = [points[moves][tip, :2] - of.parts[index].pivot_m[:2] for points in (shut, opened)]
        cosine = arm[0] @ arm[1] / np.linalg.norm(arm[0]) / np.linalg.norm(arm[1])
        assert np.degrees(np.arccos(cosine)) == pytest.approx(65.0, abs=0.01)
        assert np.linalg.norm(arm[0]) > 0.4


@pytest.mark.parametrize("name", few_derived(WITH_DOORS))
def test_an_open_door_shows_a_dark_interior_and_no_back_of_a_painted_triangle(name: str) -> None:
    of = model(name)
    shut, opened = pose_vertices(of, rows(2, doors=[0, 1]))
    triangles = o3d.core.Tensor(of.mesh.triangles.astype(np.uint32))
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(opened.astype(np.float32)), triangles)
    panel = shut[of.mesh.part == [part.name for part in of.parts].index("door front left")]
    low, high = panel.min(axis=0) + np.array([0.15, 0.0, 0.1]), panel.max(axis=0) - np.array([0.2, 0.0, 0.1])
    random = np.random.default_rng(2)
    doorway = random.uniform([low[0], high[1], low[2]], high, (4000, 3))
    directions = random.normal(size=(4000, 3)) * [0.2, 0.0, 0.2] + [0.0, -1.0, 0.0]
    hits = scene.cast_rays(o3d.core.Tensor(np.concatenate([doorway, directions], axis=1).astype(np.float32)))
    facing = np.einsum("ij,ij->i", hits["primitive_normals"].numpy(), directions) < 0.0
    hit = np.isfinite(hits["t_hit"].numpy())
    first = of.mesh.triangles[hits["primitive_ids"].numpy()[hit], 0]
    inside = np.isin(of.mesh.color[first], DARK).all(axis=1)
    assert inside.mean() > 0.7
    assert (facing[hit] | inside).mean() > 0.998


def test_a_wheelchair_rolls_on_its_rims_and_its_user_pushes_them() -> None:
    of = model("pedestrian.wheelchair")
    assert of.tag == Tag.PEDESTRIAN
    assert [part.name for part in of.parts if part.spins] == ["wheel left", "wheel right"]
    still, pushing = pose_vertices(of, rows(2, gait=np.pi / 2, wheel=[0.0, 1.0], vx=[0.0, 1.0]), "forearm left")
    assert 0.03 < np.linalg.norm(pushing - still, axis=1).max() < 0.25
    wheel = pose_vertices(of, rows(8, wheel=np.linspace(0.0, 2.0, 8)), "wheel left")
    np.testing.assert_allclose(wheel[..., 2].min(axis=1), 0.0, atol=0.01)


def seen_along_x(of: ActorModel, heading: float) -> Float64Array:
    """Materials that horizontal rays along +x or -x hit first."""
    y, z = np.meshgrid(np.linspace(-1.0, 1.0, 80), np.linspace(0.01, 1.6, 80))
    origins = np.stack([np.full(y.size, -9.0 * heading), y.ravel(), z.ravel()], axis=1)
    rays = np.concatenate([origins, np.tile([heading, 0.0, 0.0], (len(origins), 1))], axis=1).astype(np.float32)
    scene = o3d.t.geometry.RaycastingScene()
    scene.add_triangles(o3d.core.Tensor(of.mesh.vertices), o3d.core.Tensor(of.mesh.triangles.astype(np.uint32)))
    hit = scene.cast_rays(o3d.core.Tensor(rays))["primitive_ids"].numpy()
    return of.mesh.material[of.mesh.triangles[hit[hit != scene.INVALID_ID], 0]].astype(np.float64)


@pytest.mark.parametrize("name", PROPS)
def test_a_prop_is_never_traffic_and_shows_reflective_sheeting_to_approaching_traffic(name: str) -> None:
    assert blueprint(name).frequency == 0.0
    assert blueprint(name).box_class in BOX_CLASSES
    assert np.mean(seen_along_x(model(name), 1.0) == Material.PLATE) > 0.05
    if "sign" in name:
        assert np.mean(seen_along_x(model(name), -1.0) == Material.PLATE) < 0.03


def test_only_emergency_vehicles_have_beacons() -> None:
    assert [name for name in VEHICLES if len(lamp_points(name, Material.LAMP_EMERGENCY))] == EMERGENCY


@pytest.mark.parametrize("name", few_derived([name for name in NAMES if "sign" not in name]))
def test_some_surfaces_take_the_color_of_the_actor(name: str) -> None:
    assert np.isin(model(name).mesh.material, [Material.CAR_PAINT, Material.CLOTH_TINTED]).any()


@pytest.mark.parametrize("name", few_derived([name for name in VEHICLES if blueprint(name).rider]))
def test_a_riders_hands_hold_the_handlebar_and_the_rider_sits_above_the_ground(name: str) -> None:
    vehicle, rider = model(name), model(blueprint(name).rider)
    seat = np.array(blueprint(name).rider_seat_m)
    bar = pose_vertices(vehicle, rows(1), "fork")[0]
    for side in ("left", "right"):
        hand = pose_vertices(rider, rows(1), f"forearm {side}")[0] + seat
        assert np.linalg.norm(hand[:, None] - bar[None], axis=2).min() < 0.04
    assert seat[2] > 0.05


def assert_same_arrays(first: Mesh | Cycle, second: Mesh | Cycle) -> None:
    for field in fields(first):
        np.testing.assert_array_equal(getattr(first, field.name), getattr(second, field.name))


@pytest.mark.parametrize("name", ["vehicle.ambulance", "rider.bicycle", "pedestrian.man"])
def test_models_from_the_cache_are_those_that_are_built(name: str) -> None:
    cached, built = model(name), build_model(blueprint(name), load_shape(name))
    for field in fields(ActorModel):
        if field.name not in ("mesh", "cycle", "build_coarser"):
            assert getattr(cached, field.name) == getattr(built, field.name)
    assert_same_arrays(cached.mesh, built.mesh)
    assert (cached.cycle is None) == (built.cycle is None)
    if cached.cycle and built.cycle:
        assert_same_arrays(cached.cycle, built.cycle)
    for first, second in zip(cached.build_coarser(), built.build_coarser(), strict=True):
        assert first.error_m == second.error_m
        assert_same_arrays(first.mesh, second.mesh)


def test_a_shape_that_is_far_from_its_blueprints_size_is_rejected() -> None:
    longer = blueprint("vehicle.sedan").model_copy(update={"size_m": (5.2, 2.08, 1.43)})
    with pytest.raises(ValueError, match=r"the shape of vehicle\.sedan is .* its blueprint says \(5\.2"):
        build_model(longer, load_shape("vehicle.sedan"))


def test_an_unknown_finish_is_rejected() -> None:
    shape = Shape.model_validate({"solids": [{"shape": "box", "finish": "marzipan", "size": [1, 1, 1]}]})
    with pytest.raises(KeyError, match="marzipan"):
        build_model(blueprint("vehicle.sedan"), shape)


def test_a_finish_can_be_a_material_with_a_color() -> None:
    finish = finish_named("cloth #102030", Tag.RIDER, part=3)
    assert (finish.material, finish.color, finish.part) == (Material.CLOTH, (16, 32, 48), 3)
    assert replace(finish, part=0) == finish_named("cloth #102030", Tag.RIDER)
