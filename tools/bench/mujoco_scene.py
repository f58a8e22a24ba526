"""The same triangles in MuJoCo's off-screen renderer, for comparison; MuJoCo is an optional package.

What it draws is less: one color per mesh and no sky, textures, lamps, wetness or optical flow. It draws color, depth
and segmentation in three passes; the segmentation distinguishes tags and actors, as ours does.
"""

import os
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

import numpy as np

from simbev_ros.assets.actors.actor_model import ActorModel
from simbev_ros.assets.actors.posing import pose_actors
from simbev_ros.assets.placement.static_scene import StaticScene
from simbev_ros.foundation.types import AnyArray, Float64Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.frame import CameraView

_LIGHT = np.array([0.5, -0.3, -0.8])
_SHADOW_M = 150.0
_SHADOW_PX = 2048
_BODY_FROM_GL = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Rotation to MuJoCo's camera frame: x right, y up, view along -z."""


def has_mujoco() -> bool:
    """Whether the package is installed."""
    return find_spec("mujoco") is not None


class MujocoScene:
    """One moment of a scene, loaded into MuJoCo's renderer; close it after use."""

    def __init__(
        self, static: StaticScene, models: Sequence[ActorModel], state: WorldState, views: Sequence[CameraView]
    ) -> None:
        """Upload one mesh for each tag of each tile, and for each actor except the ego."""
        os.environ.setdefault("MUJOCO_GL", "egl")  # read when the package is imported
        import mujoco

        self._mujoco = mujoco
        ego = state.ego
        self._origin_m = np.array([ego["x"], ego["y"], ego["z"]])
        self._spec = mujoco.MjSpec()
        self._set_up(views[0])
        self._count = 0
        for tile in static.tiles:
            vertices_m = tile.mesh.vertices + (tile.origin_m - self._origin_m)
            for tag in np.unique(tile.mesh.triangle_tag):
                triangles = tile.mesh.triangles[tile.mesh.triangle_tag == tag]
                self._add(vertices_m, triangles, tile.mesh.color[triangles[:, 0]])
        for row in state.actors[~np.isin(state.actors["id"], sorted(state.ego_ids))]:
            posed = pose_actors(models, row[None], self._origin_m)
            self._add(posed.vertices, posed.triangles, models[row["blueprint"]].mesh.color)
        for view in views:
            self._add_camera(map_from_actors(ego.reshape(1))[0] @ view.ego_from_sensor, view)
        model = self._spec.compile()
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        height_px, width_px = views[0].camera.height_px, views[0].camera.width_px
        self._renderer = mujoco.Renderer(model, height_px, width_px, max_geom=self._count + 1)
        self._renderer.scene.flags[mujoco.mjtRndFlag.mjRND_CULL_FACE] = False  # leaves have two sides
        self._cameras = len(views)

    def render(self) -> list[tuple[AnyArray, AnyArray, AnyArray]]:
        """Draw with every camera: (H, W, 3) color, (H, W) depth in m and (H, W, 2) segmentation."""
        renderer, images = self._renderer, []
        for camera in range(self._cameras):
            renderer.update_scene(self._data, camera=camera)
            color = renderer.render()
            renderer.enable_depth_rendering()
            depth_m = renderer.render()
            renderer.enable_segmentation_rendering()
            images.append((color, depth_m, renderer.render()))
            renderer.disable_segmentation_rendering()
        return images

    def close(self) -> None:
        """Free the OpenGL context."""
        self._renderer.close()

    def _set_up(self, view: CameraView) -> None:
        """Set up a sun with a shadow map, without anti-aliasing; lengths are in m."""
        spec: Any = self._spec
        spec.stat.extent = 1.0
        spec.visual.map.znear, spec.visual.map.zfar, spec.visual.map.shadowclip = 0.1, 2000.0, _SHADOW_M
        spec.visual.quality.offsamples, spec.visual.quality.shadowsize = 0, _SHADOW_PX
        spec.visual.global_.offwidth, spec.visual.global_.offheight = view.camera.width_px, view.camera.height_px
        spec.worldbody.add_light(
            type=self._mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, pos=-100.0 * _LIGHT, dir=_LIGHT, castshadow=True
        )

    def _add(self, vertices_m: AnyArray, triangles: AnyArray, color: AnyArray) -> None:
        """Add a mesh with its mean color."""
        used, corners = np.unique(triangles, return_inverse=True)
        vertices_m = vertices_m[used]
        if len(vertices_m) < 4:  # the minimum for a mesh in MuJoCo
            vertices_m = np.concatenate([vertices_m, vertices_m[:1] + 1e-3])
        name = f"mesh {self._count}"
        self._count += 1
        mesh = self._spec.add_mesh(name=name, inertia=self._mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        mesh.uservert = vertices_m.astype(np.float32).ravel()
        mesh.userface = corners.astype(np.int32).ravel()
        self._spec.worldbody.add_geom(
            type=self._mujoco.mjtGeom.mjGEOM_MESH,
            meshname=name,
            contype=0,
            conaffinity=0,
            rgba=[*(color.mean(axis=0) / 255.0), 1.0],
        )

    def _add_camera(self, map_from_sensor: Float64Array, view: CameraView) -> None:
        quaternion = np.empty(4)
        self._mujoco.mju_mat2Quat(quaternion, (map_from_sensor[:3, :3] @ _BODY_FROM_GL).ravel())
        fovy_deg = float(np.degrees(2.0 * np.arctan(view.camera.height_px / 2.0 / view.camera.fy_px)))
        self._spec.worldbody.add_camera(pos=map_from_sensor[:3, 3] - self._origin_m, quat=quaternion, fovy=fovy_deg)
