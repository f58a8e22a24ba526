"""The static world along a route as solid triangles, and whether the box of a vehicle touches them."""

import numpy as np
import shapely

from simbev_ros.assets.materials import Material
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.assets.regions.static_cache import load_static_scene
from simbev_ros.foundation.semantics import Tag
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.maps.region import Reach
from simbev_ros.schema.scene.spec import SceneSpec

_SOLID = (
    *(Tag.BUILDING, Tag.WALL, Tag.FENCE, Tag.POLE, Tag.TRAFFIC_LIGHT, Tag.TRAFFIC_SIGN, Tag.GUARD_RAIL),
    *(Tag.VEGETATION, Tag.STATIC, Tag.DYNAMIC, Tag.OTHER),
)
_SOFT = (Material.FOLIAGE, Material.TWIG, Material.GRASS, Material.CROP)
_CLEARANCE_M = 0.3  # a vehicle passes over curbs and what lies on the road


class SolidMesh:
    """Triangles, (T, 3, 3) float64 in the map frame, that boxes of vehicles may touch."""

    def __init__(self, triangles_m: Float64Array) -> None:
        self._triangles_m = triangles_m
        low_m, high_m = triangles_m[..., :2].min(axis=1), triangles_m[..., :2].max(axis=1)
        self._tree = shapely.STRtree(shapely.box(*low_m.T, *high_m.T))

    def touched_by(self, position_m: Float64Array, yaw_rad: float, size_m: Float64Array) -> bool:
        """Whether an upright box touches a triangle: (3,) center of its bottom, heading, (3,) length, width, height."""
        radius_m = float(np.hypot(*size_m[:2])) / 2.0
        near = self._tree.query(shapely.box(*(position_m[:2] - radius_m), *(position_m[:2] + radius_m)))
        half_m = size_m / 2.0
        half_m[2] -= _CLEARANCE_M / 2.0
        center_m = position_m + np.array([0.0, 0.0, _CLEARANCE_M + half_m[2]])
        cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
        map_from_box = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        corners_m = (self._triangles_m[np.sort(near)] - center_m) @ map_from_box
        return bool(triangles_touch_box(corners_m, half_m).any())


def triangles_touch_box(corners_m: Float64Array, half_m: Float64Array) -> BoolArray:
    """(T,) whether triangles with (T, 3, 3) corners overlap a box about the origin with (3,) half sizes.

    Thirteen separating axes, as by T. Akenine-Möller, "Fast 3D triangle-box overlap testing", 2001.
    """
    edges_m = np.roll(corners_m, -1, axis=1) - corners_m
    crossed = np.cross(edges_m[:, :, None, :], np.eye(3)[None, None]).reshape(-1, 9, 3)
    normals = np.cross(edges_m[:, 0], edges_m[:, 1])[:, None]
    axes = np.concatenate([np.broadcast_to(np.eye(3), (len(corners_m), 3, 3)), normals, crossed], axis=1)
    projected = np.einsum("tax,tcx->tac", axes, corners_m)
    reach = np.abs(axes) @ half_m
    apart: BoolArray = np.any((projected.min(axis=2) > reach) | (projected.max(axis=2) < -reach), axis=1)
    return ~apart


def solid_triangles_m(static: StaticScene, corridor: shapely.Polygon) -> Float64Array:
    """(T, 3, 3) triangles of solid things with bounds that touch a corridor in plan, map frame."""
    shapely.prepare(corridor)
    found = [np.empty((0, 3, 3))]
    for tile in static.tiles:
        mesh = tile.mesh
        is_solid = np.isin(mesh.tag, _SOLID) & ~np.isin(mesh.material, _SOFT)
        triangles = mesh.triangles[is_solid[mesh.triangles[:, 0]]]
        corners_m = mesh.vertices[triangles] + tile.origin_m
        low_m, high_m = corners_m[..., :2].min(axis=1), corners_m[..., :2].max(axis=1)
        near = np.flatnonzero(
            np.all(high_m >= corridor.bounds[:2], axis=1) & np.all(low_m <= corridor.bounds[2:], axis=1)
        )
        near = near[shapely.intersects(corridor, shapely.box(*low_m[near].T, *high_m[near].T))]
        found.append(corners_m[near])
    return np.concatenate(found)


def load_static_world(spec: SceneSpec, network: RoadNetwork) -> SolidMesh:
    """Load what a vehicle can touch on the route of a scene's drive, up to where it leaves the route.

    Raises:
        InputError: The cache cannot be written.
    """
    assert spec.drive is not None
    points_m = spec.drive.route.points_m[:, :2]
    corridor = shapely.buffer(shapely.LineString(points_m), spec.drive.off_route_m)
    middle_m = (points_m.min(axis=0) + points_m.max(axis=0)) / 2.0
    radius_m = float(np.hypot(*(points_m - middle_m).T).max()) + spec.drive.off_route_m
    reach = Reach((float(middle_m[0]), float(middle_m[1])), radius_m)
    return SolidMesh(solid_triangles_m(load_static_scene(spec.map, network, reach=reach), corridor))
