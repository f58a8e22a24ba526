import numpy as np
from scipy.spatial.transform import Rotation

from simbev_ros.assets.actors.actor_model import ActorModel, Cycle
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.actors.skeletons import Skeletons
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.schema.scene.state import ACTOR_DTYPE

ORIGIN_M = np.array([1000.0, -2000.0, 5.0])


def random_actors(count: int) -> Table:
    random = np.random.default_rng(3)
    actors = np.zeros(count, ACTOR_DTYPE)
    for field in ("roll", "pitch", "yaw", "steer", "wheel", "gait", "vx", "vy"):
        actors[field] = random.normal(size=count)
    for axis, field in enumerate("xyz"):
        actors[field] = ORIGIN_M[axis] + random.uniform(-80.0, 80.0, count)
    actors["doors"] = random.integers(0, 16, count)
    actors["vx"][::3] = actors["vy"][::3] = 0.0
    actors["blueprint"] = random.permutation(np.arange(count) % len(load_models()))
    return actors


def interpolate_bilinearly(table: Float64Array, cycle: Cycle, speed_mps: float, gait_rad: float) -> float:
    """Interpolated value of an (M, N) table of a cycle."""
    phases = np.arange(table.shape[1]) * (2.0 * np.pi / table.shape[1])
    at_speeds = [np.interp(gait_rad, phases, row, period=2.0 * np.pi) for row in table]
    return float(np.interp(speed_mps, cycle.speed_mps, at_speeds))


def pose_vertex_slowly(model: ActorModel, actor: Table, vertex: int) -> Float64Array:
    """Position of one vertex: rotated with its part, its part's parent and so on, then moved with the actor."""
    point = model.mesh.vertices[vertex].astype(np.float64)
    index = int(model.mesh.part[vertex])
    gait, speed = float(actor["gait"]), float(np.hypot(actor["vx"], actor["vy"]))
    while index >= 0:
        part = model.parts[index]
        swing = (
            interpolate_bilinearly(model.cycle.turn_rad[..., index], model.cycle, speed, gait) if model.cycle else 0.0
        )
        about_y = swing + part.spins * float(actor["wheel"]) + part.cranks * gait
        is_open = int(actor["doors"]) >> part.door & 1
        about_z = part.steers * float(actor["steer"]) + is_open * part.opening_rad
        turn = Rotation.from_euler("ZY", [about_z, about_y])
        point = turn.apply(point - part.pivot_m) + part.pivot_m
        if index == 0 and model.cycle:
            point[2] += interpolate_bilinearly(model.cycle.rise_m, model.cycle, speed, gait)
        index = part.parent
    rotation = Rotation.from_euler("xyz", [float(actor[field]) for field in ("roll", "pitch", "yaw")])
    return rotation.apply(point) + [float(actor[field]) for field in "xyz"] - ORIGIN_M


def test_actors_are_posed_as_a_slow_reference_poses_single_vertices() -> None:
    actors, models = random_actors(2 * len(load_models())), load_models()
    posed = pose_actors(models, actors, ORIGIN_M)
    chosen = np.random.default_rng(5)
    start = 0
    for actor in actors:
        model = models[actor["blueprint"]]
        for vertex in chosen.integers(0, len(model.mesh.vertices), 25):
            np.testing.assert_allclose(
                posed.vertices[start + vertex], pose_vertex_slowly(model, actor, vertex), atol=3e-5
            )
        start += len(model.mesh.vertices)
    assert start == len(posed.vertices)


def test_triangles_are_in_row_order_and_name_their_row_and_their_models_vertices() -> None:
    actors, models = random_actors(30), load_models()
    posed = pose_actors(models, actors, ORIGIN_M)
    first_vertex = first_triangle = 0
    for row, actor in enumerate(actors):
        mesh = models[actor["blueprint"]].mesh
        own = slice(first_triangle, first_triangle + len(mesh.triangles))
        np.testing.assert_array_equal(posed.triangles[own], mesh.triangles + first_vertex)
        np.testing.assert_array_equal(posed.vertex_model[posed.triangles[own]], mesh.triangles)
        assert (posed.triangle_row[own] == row).all()
        first_vertex += len(mesh.vertices)
        first_triangle += len(mesh.triangles)
    assert first_triangle == len(posed.triangles) == len(posed.triangle_row)


def test_an_actor_is_posed_to_the_same_bits_whatever_other_actors_there_are() -> None:
    actors, models = random_actors(40), load_models()
    together = pose_actors(models, actors, ORIGIN_M)
    for row in (0, 17, 39):
        alone = pose_actors(models, actors[row : row + 1], ORIGIN_M)
        own = np.unique(together.triangles[together.triangle_row == row])
        np.testing.assert_array_equal(alone.vertices[np.unique(alone.triangles)], together.vertices[own])


def test_no_actors_give_empty_arrays_of_the_documented_types() -> None:
    posed = pose_actors(load_models(), np.zeros(0, ACTOR_DTYPE), ORIGIN_M)
    assert posed.vertices.shape == posed.triangles.shape == (0, 3)
    types = [array.dtype for array in (posed.vertices, posed.triangles, posed.triangle_row, posed.vertex_model)]
    assert types == [np.float32, np.int32, np.uint32, np.int32]


def test_parts_have_the_same_poses_to_the_bit_whatever_other_actors_there_are() -> None:
    actors, skeletons = random_actors(3 * len(load_models())), Skeletons(load_models())
    owner, _ = skeletons.rows(actors)
    together = skeletons.poses(actors)
    for row in range(0, len(actors), 5):
        np.testing.assert_array_equal(skeletons.poses(actors[row : row + 1]), together[owner == row])
