from collections.abc import Sequence

import numpy as np
import pytest
from synthetic_world import TICK_NS, actor, box, box_model, cart_model, mesh, static_scene, world

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.materials import Material
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import Float64Array, Table
from simbev_ros.scene.interpolation import interpolate_actors
from simbev_ros.schema.scene.state import WorldState
from simbev_ros.simulation.raycast.scene import Hits, RayScene

MODELS = (cart_model(), box_model(Tag.PEDESTRIAN, (0.4, 0.6, 1.8), Material.CLOTH))
TICK_S = TICK_NS * 1e-9


def test_points_on_a_rotating_body_move_with_it_and_static_points_do_not() -> None:
    wall = mesh(box([0, 40, 0], [80, 1, 20]), Tag.BUILDING)
    scene = RayScene(static_scene(wall), MODELS)
    state = world(actor(MODELS[0], x=-30.0), actor(MODELS[1], 1, id=9, x=10.0, vx=3.0, vy=1.0, vz=0.5, wz=2.0))
    scene.update(state, np.zeros(3), 100.0, state.ego_ids)
    directions = np.array([[1.0, 0.0, 0.1], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = scene.cast(np.zeros((1, 3)), directions)
    assert list(hits.row >= 0) == [True, False, False]
    assert scene.actors["id"][hits.row[0]] == 9
    points_m = directions * np.minimum(hits.range_m, 100.0)[:, None]
    found = scene.velocities(hits, points_m, previous=world(*np.split(state.actors, 2), tick=-1))
    # ω × r of the hit point, 0.2 m behind the axis: (-2 · 0, 2 · -0.2)
    assert found == pytest.approx(np.array([[3.0, 1.0 - 0.4, 0.5], [0, 0, 0], [0, 0, 0]]), abs=1e-5)


def hits_with_motion(
    before: WorldState, now: WorldState, models: Sequence[ActorModel]
) -> tuple[RayScene, Hits, Float64Array]:
    rng = np.random.default_rng(3)
    directions = rng.normal(size=(60_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    scene = RayScene(static_scene(mesh(box([0, 0, -50], [1, 1, 1]), Tag.ROAD)), models)
    position_m = np.array([now.actors["x"][1], now.actors["y"][1], 0.8])
    scene.update(now, position_m, 50.0, now.ego_ids)
    origins_m = position_m - 6.0 * directions
    hits = scene.cast(origins_m, directions)
    return scene, hits, origins_m + directions * np.where(np.isfinite(hits.range_m), hits.range_m, 0.0)[:, None]


@pytest.mark.parametrize("blueprint", ["vehicle.sedan", "pedestrian"])
def test_velocities_of_wheels_and_limbs_equal_the_finite_differences_of_their_vertices(blueprint: str) -> None:
    models = load_models()
    index = next(k for k, model in enumerate(models) if blueprint in model.blueprint)
    speed_mps = 12.0 if blueprint.startswith("vehicle") else 1.5
    before = world(actor(models[0], x=-60.0), actor(models[index], index, id=9, vx=speed_mps, gait=1.0), tick=0)
    moved = {"x": speed_mps * TICK_S, "wheel": speed_mps * TICK_S / 0.33, "steer": 0.02, "gait": 1.3}
    now = world(actor(models[0], x=-60.0), actor(models[index], index, id=9, vx=speed_mps, **moved), tick=1)
    scene, hits, points_m = hits_with_motion(before, now, models)
    hit = hits.row >= 0
    found = scene.velocities(hits, points_m, previous=before)[hit]

    def posed(share: float) -> tuple[Float64Array, Table]:
        rows = interpolate_actors(before.actors, now.actors, share)[1:]
        return pose_actors(models, rows, np.zeros(3)).vertices.astype(np.float64), rows

    # The mesh a millisecond before and after: each point moves with the nearest vertices' rigid part.
    (early, _), (mid, _), (late, _) = (posed(share) for share in (0.98, 1.0, 1.02))
    motion_mps = (late - early) / (0.04 * TICK_S)
    part_of_vertex = models[index].mesh.part
    for part in np.unique(hits.part[hit]):
        of_part = part_of_vertex == part
        # A rigid part's velocity is linear in the position: fit it to the vertices.
        design = np.column_stack([mid[of_part], np.ones(of_part.sum())])
        fit, *_ = np.linalg.lstsq(design, motion_mps[of_part], rcond=None)
        here = hits.part[hit] == part
        expected = np.column_stack([points_m[hit][here], np.ones(here.sum())]) @ fit
        assert np.abs(found[here] - expected).max() < 0.05
    speeds = np.linalg.norm(found - [speed_mps, 0, 0], axis=1)
    assert speeds.max() > 0.8 * speed_mps
    still = scene.velocities(hits, points_m)[hit]
    assert still == pytest.approx(np.tile([speed_mps, 0.0, 0.0], (len(still), 1)), abs=1e-5)
