"""Semantic, instance, depth and flow against brute-force rays and analytic motion."""

import numpy as np
import pytest
from render_scene import CAMERA, car, front_pose, plane, scene, snap_error_m, vertex_snap_px, world

from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.materials import Material
from simbev_ros.assets.mesh.mesh import Mesh
from simbev_ros.assets.placement.static_scene import StaticScene, Tile
from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.errors import RenderError
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = pytest.mark.gl

MAP_OFFSET = (5000.0, -8000.0, 100.0)
EGO = {"id": 1, "x": MAP_OFFSET[0], "y": MAP_OFFSET[1], "z": MAP_OFFSET[2]}
OTHER = {**EGO, "id": 77, "x": EGO["x"] + 10, "y": EGO["y"] - 1, "yaw": 0.4, "steer": 0.3, "wheel": 0.5}
VIEW = CameraView(CAMERA, front_pose(), MODALITIES)
RAYS_AT_ONCE = 256
"""Rays whose products with all triangles stay in the cache."""


@pytest.fixture(scope="module", params=[False, True], ids=["drawn", "computed"])
def renderer(request: pytest.FixtureRequest) -> Renderer:
    """Renderers with the code paths of the CPU and of GPUs."""
    return Renderer(scene(MAP_OFFSET), [car()], use_compute=request.param)


def draw(renderer: Renderer, now: WorldState, previous: WorldState | None = None) -> CameraImages:
    return renderer.render([VIEW], RenderFrame(now, previous))[0]


def map_from_optical(state: WorldState) -> Float64Array:
    return map_from_actors(state.ego.reshape(1))[0] @ front_pose() @ SENSOR_FROM_OPTICAL


def pixel_rays(camera: PinholeCamera) -> Float64Array:
    v, u = np.mgrid[: camera.height_px, : camera.width_px]
    return camera.rays(np.stack([u.ravel(), v.ravel()], axis=1))


def cast(
    origin: Float64Array, rays: Float64Array, corners: Float64Array
) -> tuple[Float64Array, AnyArray, Float64Array]:
    """Nearest depth, triangle and its barycentric margin (0 on an edge) per ray (Möller-Trumbore)."""
    if len(rays) > RAYS_AT_ONCE:
        parts = [cast(origin, part, corners) for part in np.array_split(rays, len(rays) // RAYS_AT_ONCE + 1)]
        depth, nearest, margin = (np.concatenate(each) for each in zip(*parts, strict=True))
        return depth, nearest, margin
    edge1, edge2 = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse_determinant = 1.0 / (rays @ np.cross(edge2, edge1).T)
        s = origin - corners[:, 0]
        u = rays @ np.cross(edge2, s).T * inverse_determinant
        q = np.cross(s, edge1)
        v = rays @ q.T * inverse_determinant
        depth = (q * edge2).sum(axis=-1) * inverse_determinant
        margin = np.minimum(np.minimum(u, v), 1.0 - u - v)
        depth = np.where((margin >= 0.0) & (depth > 0.0), depth, np.inf)
    nearest = depth.argmin(axis=1)
    rows = np.arange(len(rays))
    return depth[rows, nearest], nearest, margin[rows, nearest]


def triangles(now: WorldState) -> tuple[Float64Array, AnyArray]:
    """(T, 3, 3) corners relative to the map offset and (T,) tags of all visible meshes; the other car's come last."""
    posed = pose_actors([car()], now.actors[1:], np.array(MAP_OFFSET))
    tiles = scene().tiles
    corners = [(tile.mesh.vertices.astype(np.float64) + tile.origin_m)[tile.mesh.triangles] for tile in tiles]
    corners.append(posed.vertices.astype(np.float64)[posed.triangles])
    tags = np.concatenate([*(tile.mesh.triangle_tag for tile in tiles), car().mesh.triangle_tag])
    return np.concatenate(corners), tags


def test_labels_and_depth_agree_with_brute_force_rays(renderer: Renderer) -> None:
    now = world(EGO, OTHER)
    images = draw(renderer, now)
    corners, tags = triangles(now)
    ids = np.where(np.arange(len(tags)) < len(tags) - len(car().mesh.triangles), 0, 77)

    pose = map_from_optical(now)
    rays = pixel_rays(CAMERA) @ pose[:3, :3].T
    depth, triangle, _ = cast(pose[:3, 3] - MAP_OFFSET, rays, corners)
    sky = np.isinf(depth)
    semantic = np.where(sky, Tag.SKY, tags[triangle]).reshape(90, 160)
    instance = np.where(sky, 0, ids[triangle]).reshape(90, 160)

    assert images.semantic is not None and images.instance is not None and images.depth is not None
    agrees = (images.semantic == semantic) & (images.instance == instance)
    assert agrees.mean() > 0.9995  # rays that graze an edge may fall on either side
    assert set(np.unique(semantic)) == {Tag.ROAD, Tag.BUILDING, Tag.VEGETATION, Tag.SKY, Tag.CAR}
    expected = depth.reshape(90, 160)
    assert np.isinf(images.depth[agrees & sky.reshape(90, 160)]).all()
    near = agrees & (expected < 60.0)
    off_m = np.abs(images.depth[near] - expected[near])
    assert (off_m > 1e-3 + snap_error_m(CAMERA, expected[near])).mean() < 5e-4 + vertex_snap_px()


def test_depth_of_a_wall_50_m_ahead_is_exact_to_a_millimeter() -> None:
    wall = plane(60.0, 0.0, Tag.WALL, Material.CONCRETE).transform(
        matrices_from_xyz_rpy(np.array([50.0, 0.0, 0.0]), np.array([0.0, -np.pi / 2, 0.0]))
    )
    view = CameraView(CAMERA, np.eye(4), ("depth",))
    [images] = Renderer(StaticScene((Tile(np.zeros(3), wall, {}),), ()), [car()]).render(
        [view], RenderFrame(world({"id": 1}))
    )
    assert images.depth is not None
    assert np.abs(images.depth - 50.0).max() < 1e-3
    assert images.semantic is None


def was_visible(before: WorldState, points: Float64Array, is_sky: AnyArray) -> AnyArray:
    """(N,) whether (N, 3) points, or directions to the sky, in the optical frame were visible in a world's image."""
    pose = map_from_optical(before)
    rays = points / points[:, 2:]
    depth = cast(pose[:3, 3] - MAP_OFFSET, rays @ pose[:3, :3].T, triangles(before)[0])[0]
    at = CAMERA.project(points)
    inside = np.all((at >= -0.5) & (at < np.array([CAMERA.width_px, CAMERA.height_px]) - 0.5), axis=1)
    return inside & (points[:, 2] > 0) & np.where(is_sky, np.isinf(depth), depth * 1.005 + 0.05 > points[:, 2])


def test_flow_of_static_and_moving_objects_equals_their_reprojection(renderer: Renderer) -> None:
    now = world(EGO, OTHER)
    before = world(
        {**EGO, "x": EGO["x"] - 0.7, "y": EGO["y"] + 0.1, "yaw": -0.03, "pitch": 0.01},
        {**OTHER, "x": OTHER["x"] - 0.5, "yaw": 0.35, "steer": 0.2, "wheel": 0.1},
    )
    images = draw(renderer, now, before)
    assert images.flow is not None and images.depth is not None and images.instance is not None

    ego_at = np.array(MAP_OFFSET)
    then_from_map, pose = inverse(map_from_optical(before)), map_from_optical(now)
    rays = pixel_rays(CAMERA)
    pixels = rays[:, :2] * [CAMERA.fx_px, CAMERA.fy_px] + [CAMERA.cx_px, CAMERA.cy_px]

    flow = images.flow.reshape(-1, 2)
    seen = ~np.isnan(flow[:, 0])
    sky = np.isinf(images.depth).ravel()
    turned = rays @ (then_from_map @ pose)[:3, :3].T
    np.testing.assert_allclose(flow[sky & seen], (pixels - CAMERA.project(turned))[sky & seen], atol=2e-3)

    still = ~sky & (images.instance.ravel() == 0)
    then = turned
    then[still] = apply(then_from_map @ pose, rays[still] * images.depth.reshape(-1, 1)[still])
    np.testing.assert_allclose(flow[still & seen], (pixels - CAMERA.project(then))[still & seen], atol=2e-3)

    was_seen = was_visible(before, then, sky)
    standing = sky | still
    assert (was_seen == seen)[standing].mean() > 0.995, "all but pixels at silhouettes"
    at = CAMERA.project(then)
    inside = np.all((at > 0) & (at < [CAMERA.width_px - 1, CAMERA.height_px - 1]), axis=1)
    assert (~seen & inside & standing).sum() > 30, "what the car hid"
    assert (~seen & ~inside & standing).sum() > 100, "what was outside the image"

    moving = images.instance.ravel() == 77
    posed_now, posed_then = (pose_actors([car()], state.actors[1:], ego_at) for state in (now, before))
    corners_now, corners_then = (p.vertices.astype(np.float64)[p.triangles] for p in (posed_now, posed_then))
    depth, triangle, margin = cast(pose[:3, 3] - ego_at, (rays @ pose[:3, :3].T)[moving], corners_now)
    hit = pose[:3, 3] - ego_at + (rays @ pose[:3, :3].T)[moving] * depth[:, None]
    a, b, c = np.moveaxis(corners_now[triangle], 1, 0)
    weights = np.linalg.solve(np.stack([b - a, c - a, np.cross(b - a, c - a)], axis=-1), (hit - a)[..., None])[:, :2, 0]
    a, b, c = np.moveaxis(corners_then[triangle], 1, 0)
    hit_then = a + (b - a) * weights[:, :1] + (c - a) * weights[:, 1:] + ego_at
    expected = pixels[moving] - CAMERA.project(apply(then_from_map, hit_then))
    inner = (margin > 0.02) & seen[moving]
    assert inner.mean() > 0.6
    parts = car().mesh.part[car().mesh.triangles[triangle[inner], 0]]
    assert len(np.unique(parts)) >= 3, "body and turning wheels must be seen"
    np.testing.assert_allclose(flow[moving][inner], expected[inner], atol=8e-3)


def test_flow_is_zero_without_a_previous_frame(renderer: Renderer) -> None:
    flow = draw(renderer, world(EGO, OTHER)).flow
    assert flow is not None and not flow.any()


def test_the_flow_of_frames_in_a_row_equals_that_of_single_ones(renderer: Renderer) -> None:
    states = [world(EGO, {**OTHER, "y": OTHER["y"] + shift_m}) for shift_m in (0.0, 0.6, 1.2)]
    in_a_row = [draw(renderer, now, before) for before, now in zip([None, *states[:-1]], states, strict=True)]
    draw(renderer, world({**EGO, "x": EGO["x"] + 15.0}))
    single = draw(renderer, states[2], states[1]).flow
    assert single is not None and in_a_row[2].flow is not None
    np.testing.assert_array_equal(in_a_row[2].flow, single)
    assert in_a_row[1].instance is not None and in_a_row[2].instance is not None
    uncovered = (in_a_row[1].instance == 77) & (in_a_row[2].instance == 0)
    assert uncovered.sum() > 30 and np.isnan(single[uncovered]).mean() > 0.9


def test_flow_is_nan_where_the_point_was_behind_the_previous_camera(renderer: Renderer) -> None:
    images = draw(renderer, world(EGO), world({**EGO, "x": EGO["x"] + 15.0}))
    assert images.flow is not None and images.depth is not None
    unseen = np.isnan(images.flow[..., 0])
    assert unseen[images.depth < 14.0].all() and not unseen[30:60, 60:100][images.depth[30:60, 60:100] > 60.0].any()


def test_the_ego_and_its_rider_are_drawn_only_on_request(renderer: Renderer) -> None:
    behind = matrices_from_xyz_rpy(np.array([-8.0, 0.0, 2.0]), np.zeros(3))
    view = CameraView(CAMERA, behind, ("instance",))
    state = world(EGO, {**EGO, "id": 5, "parent": 1, "z": EGO["z"] + 1.5})
    for show_ego, expected in ((False, {0}), (True, {0, 1, 5})):
        [images] = renderer.render([view], RenderFrame(state, show_ego=show_ego))
        assert images.instance is not None and set(np.unique(images.instance)) == expected


def test_an_actor_id_too_large_for_instance_images_is_refused(renderer: Renderer) -> None:
    with pytest.raises(RenderError, match="largest actor id 65536"):
        draw(renderer, world(EGO, {**OTHER, "id": 65536}))


def test_slivers_seen_edge_on_have_a_depth_in_front_of_the_camera() -> None:
    """Their inverse depth changes sign within the rounding of a pixel: llvmpipe gave -697 m for one of these."""
    camera, rng, count = PinholeCamera(704, 256, 419.5, 419.5, 352, 58), np.random.default_rng(8), 20_000
    first = rng.uniform((-0.8, -0.4), (0.8, 0.1), (count, 2))
    second = first + rng.normal(0, 0.1, (count, 2))
    between = first + (second - first) * rng.uniform(size=(count, 1))
    between += rng.normal(size=(count, 2)) * 10.0 ** rng.uniform(-6.5, -3.5, (count, 1))
    rays = np.stack([np.column_stack([np.ones(count), each]) for each in (first, second, between)], axis=1)
    corners = rays * 10.0 ** rng.uniform(0.5, 2.9, (count, 3, 1))
    slivers = Mesh.flat(corners, material=Material.CONCRETE, tag=Tag.SIDEWALK, color=(120, 120, 120))
    renderer = Renderer(StaticScene((Tile(np.zeros(3), slivers, {}),), ()), [car()], use_compute=False)
    [images] = renderer.render([CameraView(camera, np.eye(4), ("depth",))], RenderFrame(world({"id": 1})))
    assert images.depth is not None
    depth_m = images.depth[np.isfinite(images.depth)]
    assert len(depth_m) > 1000
    assert depth_m.min() > 0
