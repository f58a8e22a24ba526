import weakref
from dataclasses import fields

import numpy as np
import pytest
from synthetic_world import EGO_ID, actor, box, box_model, cart_model, mesh, sheet, static_scene, world

from simbev_ros.assets.actors.actor_model import ActorModel, Part
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Int64Array
from simbev_ros.scene.interpolation import ActorHistory, interpolate_actors
from simbev_ros.simulation.raycast.scene import RayScene

ORIGIN = np.zeros(3)
MODELS = (cart_model(), box_model(Tag.PEDESTRIAN, (0.4, 0.6, 1.8), Material.CLOTH))


def first_triangles(
    origins: Float64Array, directions: Float64Array, corners: Float64Array
) -> tuple[Float64Array, Int64Array, Float64Array]:
    """First hits by brute force (Möller and Trumbore): ranges, triangles, and barycentric distances to an edge."""
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(directions[:, None], edge2)
    determinant = np.einsum("rti,ti->rt", p, edge1)
    determinant[np.abs(determinant) < 1e-12] = np.inf
    s = origins[:, None] - corners[:, 0]
    u = np.einsum("rti,rti->rt", s, p) / determinant
    q = np.cross(s, edge1)
    v = np.einsum("rti,ri->rt", q, directions) / determinant
    range_m = np.einsum("rti,ti->rt", q, edge2) / determinant
    inside = np.minimum(np.minimum(u, v), 1 - u - v)
    range_m[(inside < 0) | (range_m <= 0) | np.isinf(determinant)] = np.inf
    first = np.argmin(range_m, axis=1)
    margin = np.abs(np.where(np.isinf(determinant), np.inf, inside)).min(axis=1)
    return range_m[np.arange(len(first)), first], first, margin


def unit_vectors(rng: np.random.Generator, count: int, flatness: float = 1.0) -> Float64Array:
    directions = rng.normal(size=(count, 3)) * [1.0, 1.0, flatness]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions


@pytest.mark.parametrize("shared_origin", [True, False])
def test_hits_equal_those_of_brute_force(shared_origin: bool) -> None:
    rng = np.random.default_rng(1)
    position_m = np.array([8000.0, -9000.0, 30.0])
    soup = rng.uniform(-20, 20, (60, 1, 3)) + rng.uniform(-2, 2, (60, 3, 3))
    rows = [actor(MODELS[0], id=EGO_ID, x=position_m[0], y=position_m[1], z=position_m[2])]
    for index in range(1, 9):
        x, y = rng.uniform(-12, 12, 2) + position_m[:2]
        pose = dict(zip(("yaw", "pitch", "steer", "wheel"), rng.uniform(-1, 1, 4), strict=True))
        rows.append(actor(MODELS[index % 2], index % 2, id=100 - index, x=x, y=y, z=position_m[2], **pose))
    state = world(*rows)
    scene = RayScene(static_scene(mesh(soup, Tag.VEGETATION, Material.FOLIAGE), origin_m=position_m), MODELS)
    scene.update(state, position_m, 100.0)
    count = 6000
    offsets = np.tile([[0.1, 0.2, 2.5]], (count, 1)) if shared_origin else rng.uniform(-8, 8, (count, 3))
    directions = unit_vectors(rng, count, 0.3)
    hits = scene.cast(position_m + (offsets[:1] if shared_origin else offsets), directions)

    posed = pose_actors(MODELS, state.actors, position_m)
    corners = np.concatenate([soup, posed.vertices.astype(np.float64)[posed.triangles]])
    range_m, first, margin = first_triangles(offsets, directions, corners)
    clear = margin > 1e-4
    assert clear.mean() > 0.9
    hit = np.isfinite(range_m)
    assert np.array_equal(np.isfinite(hits.range_m)[clear], hit[clear])
    assert not hits.object_id[clear & ~hit].any()
    assert not hits.tag[clear & ~hit].any()
    both = clear & hit
    assert np.abs(hits.range_m[both] - range_m[both]).max() < 2e-4
    owner = np.concatenate([np.zeros(len(soup), np.uint32), state.actors["id"][posed.triangle_row]])
    assert np.array_equal(hits.object_id[both], owner[first[both]])
    assert len(np.unique(hits.object_id[both])) == 10
    tag = np.concatenate([np.full(len(soup), Tag.VEGETATION), state.actors["tag"][posed.triangle_row]])
    assert np.array_equal(hits.tag[both], tag[first[both]])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[first[both]]
    normal *= -np.sign(np.einsum("ni,ni->n", normal, directions[both]))[:, None]
    assert np.abs(hits.normal[both] - normal / np.linalg.norm(normal, axis=1, keepdims=True)).max() < 1e-3


def test_rays_aimed_at_vertices_of_parts_hit_them_from_all_sides() -> None:
    rng = np.random.default_rng(4)
    parts = (Part("body"), Part("left", opening_rad=0.2), Part("right", door=1, opening_rad=-0.2))
    posts = [mesh(box([0, 0.4 * index, 1.0], [0.1, 0.1, 1.0]), Tag.OTHER, part=index) for index in range(3)]
    model = ActorModel("posts", Tag.OTHER, "", Mesh.merge(posts), (0.1, 0.9, 1.5), parts, 0.0)
    state = world(actor(model, x=6.0, yaw=0.4, doors=3))
    posed = pose_actors([model], state.actors, ORIGIN)
    corners = posed.vertices.astype(np.float64)[posed.triangles]
    count = 8000
    directions = unit_vectors(rng, count)
    targets = posed.vertices[rng.integers(len(posed.vertices), size=count)] + rng.normal(scale=0.03, size=(count, 3))
    origins = targets - 5.0 * directions
    scene = RayScene(StaticScene((), ()), [model])
    scene.update(state, ORIGIN, 50.0)
    hits = scene.cast(origins, directions)
    range_m, _, margin = first_triangles(origins, directions, corners)
    clear = margin > 1e-4
    hit = np.isfinite(range_m)
    assert 0.2 < hit.mean() < 0.8
    assert np.array_equal(np.isfinite(hits.range_m)[clear], hit[clear])
    assert np.abs(hits.range_m[clear & hit] - range_m[clear & hit]).max() < 1e-4


def test_ranges_on_a_large_map_are_exact_to_a_tenth_of_a_millimeter() -> None:
    position_m = np.array([9876.5, -9876.25, 123.0])
    ground = mesh(sheet([-50, -50], [50, 50]), Tag.ROAD, Material.ASPHALT)
    scene = RayScene(static_scene(ground, origin_m=position_m), MODELS)
    scene.update(world(actor(MODELS[0], x=position_m[0], y=position_m[1], z=500.0)), position_m, 60.0)
    hits = scene.cast(position_m + np.array([[3.25, 1.5, 1.8]]), np.array([[0.0, 0.0, -1.0], [0.6, 0.0, -0.8]]))
    assert hits.range_m == pytest.approx([1.8, 2.25], abs=1e-4)
    assert hits.normal == pytest.approx(np.array([[0, 0, 1], [0, 0, 1]]))
    assert list(hits.material) == [Material.ASPHALT] * 2


def test_rays_pass_through_hidden_actors_and_hit_the_wall_behind() -> None:
    wall = mesh(box([10, 0, 0], [1, 20, 20]), Tag.BUILDING, Material.BRICK)
    pedestrian = actor(MODELS[1], 1, id=9, x=4.0)
    state = world(actor(MODELS[0], x=-20.0), pedestrian)
    scene = RayScene(static_scene(wall), MODELS)
    ray = np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]])
    scene.update(state, ORIGIN, 50.0)
    seen = scene.cast(*ray)
    assert (seen.object_id[0], seen.tag[0], seen.material[0]) == (9, Tag.PEDESTRIAN, Material.CLOTH)
    assert seen.range_m[0] == pytest.approx(3.8)
    scene.update(state, ORIGIN, 50.0, hidden_ids={9})
    seen = scene.cast(*ray)
    assert (seen.object_id[0], seen.tag[0], seen.material[0]) == (0, Tag.BUILDING, Material.BRICK)
    assert seen.range_m[0] == pytest.approx(9.5)


def test_hits_do_not_depend_on_earlier_updates() -> None:
    rng = np.random.default_rng(2)
    tiles = []
    for x in range(-400, 400, 50):
        for y in range(-100, 100, 50):
            lumps = rng.uniform(0, 50, (40, 1, 3)) * [1, 1, 0.2] + rng.uniform(-3, 3, (40, 3, 3))
            parts = [mesh(lumps, Tag.VEGETATION), mesh(sheet([0, 0], [50, 50]), Tag.ROAD)]
            tiles += static_scene(*parts, origin_m=(x, y, 0)).tiles
    static = StaticScene(tuple(tiles), ())
    state = world(actor(MODELS[0], x=150.0), actor(MODELS[0], id=8, x=165.0, y=3.0, yaw=0.4))
    directions = unit_vectors(rng, 20_000, 0.2)
    origin = np.array([[151.0, 1.0, 2.0]])
    fresh, travelled = RayScene(static, MODELS), RayScene(static, MODELS)
    for x_m in (-300.0, 20.0, 90.0, 149.0):
        travelled.update(state, np.array([x_m, 0.0, 0.0]), 80.0)
        travelled.cast(origin, directions[:10])
    for scene in (fresh, travelled):
        scene.update(state, origin[0], 80.0)
    one, other = fresh.cast(origin, directions), travelled.cast(origin, directions)
    for name in ("range_m", "object_id", "tag", "material", "normal"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def wide_static_scene() -> StaticScene:
    """Ground and bushes in tiles over several of the cells by which static triangles are cached."""
    rng = np.random.default_rng(3)
    tiles = []
    for x in range(-200, 1200, 100):
        lumps = rng.uniform(0, 100, (40, 1, 3)) * [1, 1, 0.1] + rng.uniform(-3, 3, (40, 3, 3))
        tiles += static_scene(
            mesh(lumps, Tag.VEGETATION), mesh(sheet([0, 0], [100, 100]), Tag.ROAD), origin_m=(x, 0, 0)
        ).tiles
    return StaticScene(tuple(tiles), ())


def test_scenes_of_one_world_share_its_models_and_the_triangles_of_a_cell() -> None:
    one = RayScene(wide_static_scene(), MODELS)
    other = one.another()
    assert other.parts is one.parts
    here, near, elsewhere = (np.array([x_m, 50.0, 0.0]) for x_m in (10.0, 90.0, 700.0))
    triangles = one.static.triangles_around(here, 60.0)
    assert other.static.triangles_around(near, 60.0) is triangles, "both are in one cell of 128 m"
    assert other.static.triangles_around(near, 61.0) is not triangles
    assert other.static.triangles_around(elsewhere, 60.0) is not triangles


def test_a_scene_that_moves_away_takes_no_cells_from_another_one() -> None:
    resting = RayScene(wide_static_scene(), MODELS)
    moving = resting.another()
    here = np.array([10.0, 50.0, 0.0])
    triangles = resting.static.triangles_around(here, 60.0)
    for x_m in range(10, 1000, 100):
        moving.static.triangles_around(np.array([float(x_m), 50.0, 0.0]), 60.0)
    assert resting.static.triangles_around(here, 60.0) is triangles
    gone = weakref.ref(moving.static.triangles_around(np.array([900.0, 50.0, 0.0]), 60.0))
    assert gone() is not None
    for x_m in (10.0, 200.0, 400.0):
        moving.static.triangles_around(np.array([x_m, 50.0, 0.0]), 60.0)
    assert gone() is None, "a cell that no scene keeps is freed"


def test_scenes_of_one_world_do_not_disturb_each_other() -> None:
    rng, static = np.random.default_rng(4), wide_static_scene()
    state = world(actor(MODELS[0], x=30.0, y=40.0), actor(MODELS[0], id=8, x=44.0, y=47.0, yaw=0.4))
    directions = unit_vectors(rng, 5000, 0.3)
    centers_m = np.array([[30.0, 40.0, 2.0], [44.0, 47.0, 2.0]])
    shared = [RayScene(static, MODELS)]
    shared.append(shared[0].another())
    alone = [RayScene(static, MODELS), RayScene(static, MODELS)]
    for scenes in (shared, alone):
        for scene, center_m, hidden_id in zip(scenes, centers_m, (EGO_ID, 8), strict=True):
            scene.update(state, center_m, 80.0, {hidden_id})
    for one, other, center_m, seen_id in zip(shared, alone, centers_m, (8, EGO_ID), strict=True):
        hits, expected = one.cast(center_m[None], directions), other.cast(center_m[None], directions)
        assert set(np.unique(hits.object_id)) == {0, seen_id}
        for field in fields(hits):
            assert getattr(hits, field.name).tobytes() == getattr(expected, field.name).tobytes()


def test_rays_hit_nothing_in_an_empty_world() -> None:
    scene = RayScene(StaticScene((), ()), MODELS)
    scene.update(world(actor(MODELS[0])), ORIGIN, 50.0, hidden_ids={EGO_ID})
    hits = scene.cast(np.array([[0.0, 0.0, 1.0]]), np.array([[1.0, 0.0, 0.0]]))
    assert np.isinf(hits.range_m).all()
    assert not hits.object_id.any()


def test_rays_cast_before_the_tick_hit_actors_at_their_earlier_poses() -> None:
    rng = np.random.default_rng(6)
    states = []
    for tick in (-2, -1, 0):
        pose = {"yaw": 3.0 + 0.2 * tick, "steer": 0.3 * tick, "wheel": 50.0 + 2.4 * tick, "z": 0.2 * tick}
        other = {"x": -5.0 + 0.3 * tick, "y": 4.0, "yaw": -3.1 - 0.2 * tick}
        rows = [actor(MODELS[0], x=-60.0), actor(MODELS[0], id=8, x=6.0 + 1.1 * tick, y=0.5 * tick, **pose)]
        states.append(world(*rows, actor(MODELS[1], 1, id=9, **other), tick=tick))
    now = states[-1]
    scene = RayScene(StaticScene((), ()), MODELS)
    scene.update(now, ORIGIN, 30.0, now.ego_ids, states[:-1])
    lags_s = np.array([0.1, 0.087, 0.061, 0.05, 0.02, 0.0])
    origins = rng.uniform([-1.0, -1.0, 0.0], [1.0, 1.0, 2.0], (6000, 3))
    targets = np.where(rng.random((6000, 1)) < 0.7, [5.0, 0.0, 0.6], [-5.2, 4.0, 0.8]) + rng.normal(size=(6000, 3))
    directions = (targets - origins) / np.linalg.norm(targets - origins, axis=1, keepdims=True)
    lag_s = np.repeat(lags_s, 1000)
    hits = scene.cast(origins, directions, lag_s)
    course = ActorHistory.of(now, states[:-1])
    for lag in lags_s:
        at_lag = lag_s == lag
        posed = pose_actors(MODELS, course.at(np.array([1, 2]), np.full(2, lag)), ORIGIN)
        corners = posed.vertices.astype(np.float64)[posed.triangles]
        range_m, first, margin = first_triangles(origins[at_lag], directions[at_lag], corners)
        clear, hit = margin > 1e-4, np.isfinite(range_m)
        assert 200 < hit.sum() < 800
        assert np.array_equal(np.isfinite(hits.range_m[at_lag])[clear], hit[clear])
        both = clear & hit
        assert np.abs(hits.range_m[at_lag][both] - range_m[both]).max() < 2e-4
        assert np.array_equal(hits.object_id[at_lag][both], np.array([8, 9])[posed.triangle_row[first[both]]])


def test_between_ticks_headings_turn_the_shorter_way_and_wheels_roll_on() -> None:
    before = actor(MODELS[0], yaw=3.1, gait=6.2, wheel=100.0, x=2.0)
    after = actor(MODELS[0], yaw=-3.1, gait=0.1, wheel=105.0, x=4.0, doors=1)
    row = interpolate_actors(before, after, 0.25)[0]
    assert row["x"] == 2.5
    assert row["yaw"] == pytest.approx(3.1 + 0.25 * (2 * np.pi - 6.2), abs=1e-6)
    assert row["gait"] == pytest.approx(6.2 + 0.25 * (2 * np.pi - 6.1), abs=1e-6)
    assert np.cos(row["wheel"]) == pytest.approx(np.cos(101.25), abs=1e-5)
    assert row["doors"] == 1


def test_an_actor_without_an_earlier_state_stands_still() -> None:
    now = world(actor(MODELS[0]), actor(MODELS[1], 1, id=9, x=5.0, vx=2.0), tick=1)
    course = ActorHistory.of(now, [world(actor(MODELS[0], x=-3.0))])
    assert list(course.at(np.array([0, 1]), np.array([0.025, 0.025]))["x"]) == [-1.5, 5.0]
    assert course.at(np.array([0]), np.array([9.0]))["x"][0] == -3.0
