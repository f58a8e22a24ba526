"""A posed camera as shaders and culling need it: matrices relative to the frame's origin, and visibility tests.

A ``CameraView`` and a ``WorldState`` enter, a ``View`` leaves. "World" is the map frame translated to the frame's
origin (the ego), so that float32 on the GPU is accurate on large maps.
"""

from dataclasses import dataclass, replace

import numpy as np

from simbev_ros.foundation.geometry.camera import PinholeCamera, ideal_camera
from simbev_ros.foundation.geometry.fisheye import Face, FisheyeCamera, cube_faces
from simbev_ros.foundation.geometry.transforms import SENSOR_FROM_OPTICAL, inverse
from simbev_ros.foundation.types import BoolArray, Float64Array
from simbev_ros.schema.scene.state import WorldState, map_from_actors
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.lighting.exposure import ShutterTimes, exposure_gain, shutter_times

NEAR_M = 0.1
FAR_M = 10_000.0
"""Beyond the hills at the horizon (``assets/regions/far_land.py``), seen across a whole town."""
_MARGIN_STEP_PX, _WIDTH_PER_MARGIN = 12, 64
"""Margin in which the G-buffer of a rolling shutter has what other rows' times show: a multiple of the steps of shading
(``quality_steps``), about this part of the image's width."""
VIEW_BLOCK_BYTES = (3 * 4 + 2) * 16


@dataclass(frozen=True, slots=True)
class View:
    """A posed camera with its projection and view frustum tests.

    Attributes:
        camera: Intrinsics, without distortion (``simulation/render/lens.py``).
        world_from_optical: (4, 4) pose of the optical frame.
        clip_from_world: (4, 4) projection of world points to OpenGL's clip space.
        previous_optical_from_world: (4, 4) inverse pose of the camera in the previous frame, or None.
        exposure_gain: Brightness of the color image relative to automatic exposure.
        face: The face of a fisheye's view that this is, ``camera`` being that of the face; None for other cameras.
        fisheye_px: Pixels per radian of the fisheye where it is finest; 0 for other cameras.
        shutter: Times of the camera's shutter; None: its images show one moment.
        before_optical_from_world: (4, 4) inverse pose of the camera ``MOTION_S`` earlier, or None.
    """

    camera: PinholeCamera
    world_from_optical: Float64Array
    clip_from_world: Float64Array
    previous_optical_from_world: Float64Array | None
    exposure_gain: float = 1.0
    face: Face | None = None
    fisheye_px: float = 0.0
    shutter: ShutterTimes | None = None
    before_optical_from_world: Float64Array | None = None

    @classmethod
    def of_camera(
        cls,
        view: CameraView,
        world: WorldState,
        previous: WorldState | None,
        origin_m: Float64Array,
        adaptation: float = 1.0,
        shortly_before: WorldState | None = None,
    ) -> list["View"]:
        """View of a camera of the ego, in the world with its origin at (3,) ``origin_m`` in the map frame.

        That of a fisheye consists of several faces; the first one has the fisheye's own optical frame. ``adaptation``
        is the factor by which automatic exposure differs from that of the weather; ``shortly_before`` is the world
        ``MOTION_S`` earlier.
        """
        exposure, shutter = view.optics.exposure, view.shutter
        times = shutter_times(exposure, shutter, world.weather, adaptation) if shutter else None
        gain = exposure_gain(exposure, world.weather, adaptation)
        faces = cube_faces(view.camera) if isinstance(view.camera, FisheyeCamera) else (None,)
        fisheye_px = max(face.camera.fx_px if face else 0.0 for face in faces)
        views = []
        for face in faces:
            ego_from_optical = view.ego_from_sensor @ SENSOR_FROM_OPTICAL
            if face is not None:
                ego_from_optical[:3, :3] = ego_from_optical[:3, :3] @ face.optical_from_face
            camera = ideal_camera(view.camera) if face is None else face.camera
            if view.rolls:
                camera = _padded(camera, _rolling_margin_px(camera))
            previous_pose, before_pose = (
                None if earlier is None else inverse(_world_from_ego(earlier, origin_m) @ ego_from_optical)
                for earlier in (previous, shortly_before)
            )
            pose = _world_from_ego(world, origin_m) @ ego_from_optical
            clip_from_world = _clip_from_optical(camera) @ inverse(pose)
            views.append(cls(camera, pose, clip_from_world, previous_pose, gain, face, fisheye_px, times, before_pose))
        return views

    @property
    def position_m(self) -> Float64Array:
        """(3,) optical center in the world."""
        return self.world_from_optical[:3, 3]

    def sees_spheres(self, centers_m: Float64Array, radii_m: Float64Array) -> BoolArray:
        """(N,) whether spheres around (N, 3) world points reach into the view."""
        planes = _planes(self.clip_from_world)
        return np.all(centers_m @ planes[:, :3].T + planes[:, 3] >= -radii_m[:, None], axis=1)

    def sees_shadows(self, centers_m: Float64Array, radii_m: Float64Array, light: Float64Array) -> BoolArray:
        """(N,) whether shadows of spheres around (N, 3) world points, lit from (3,) ``light``, reach into the view."""
        planes = _planes(self.clip_from_world)
        reaches = centers_m @ planes[:, :3].T + planes[:, 3] >= -radii_m[:, None]
        return np.all(reaches | (planes[:, :3] @ light < 0.0), axis=1)

    def sees_boxes(self, low_m: Float64Array, high_m: Float64Array) -> BoolArray:
        """(N,) whether axis-aligned boxes, given by two (N, 3) world corners, reach into the view."""
        return boxes_in_clip_space(self.clip_from_world, low_m, high_m)

    def pixel_m(self, centers_m: Float64Array, radii_m: Float64Array) -> Float64Array:
        """(N,) minimum size of a pixel in spheres around (N, 3) world points, across the line of sight, m.

        For low resolutions, the value of a higher one is used: 0.1 % of the distance, so that smaller geometric errors
        stay invisible in depth images. All faces of a fisheye agree.
        """
        to_center = centers_m - self.position_m
        distance_m = np.maximum(np.linalg.norm(to_center, axis=1), 1e-6)
        if self.face is not None:
            return np.maximum(distance_m - radii_m, 0.0) / max(self.fisheye_px, 1000.0)
        ahead_m = to_center @ self.world_from_optical[:3, 2]
        nearest = np.maximum(ahead_m - radii_m, 0.0) / max(self.camera.fx_px, self.camera.fy_px, 1000.0)
        return nearest * np.clip(ahead_m / distance_m, 0.0, 1.0)  # off the axis, images are stretched

    def motion_block(self) -> bytes:
        """Data of the same uniform block as ``block`` with the camera's pose ``MOTION_S`` earlier as previous pose."""
        return replace(self, previous_optical_from_world=self.before_optical_from_world).block()

    def block(self) -> bytes:
        """Data of the uniform block ``View`` of shaders/include/view.glsl, std140."""
        camera = self.camera
        previous = np.eye(4) if self.previous_optical_from_world is None else self.previous_optical_from_world
        has_previous = float(self.previous_optical_from_world is not None)
        matrices = [self.clip_from_world.T, self.world_from_optical.T, previous.T]
        vectors = [
            [camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px],
            [camera.width_px, camera.height_px, has_previous, self.exposure_gain],
        ]
        return np.concatenate([*matrices, np.array(vectors)]).astype(np.float32).tobytes()


def boxes_in_clip_space(clip_from_world: Float64Array, low_m: Float64Array, high_m: Float64Array) -> BoolArray:
    """(N,) whether axis-aligned boxes, given by two (N, 3) world corners, intersect the volume of a projection."""
    planes = _planes(clip_from_world)
    center, half = (low_m + high_m) / 2.0, (high_m - low_m) / 2.0
    reach = half @ np.abs(planes[:, :3]).T
    return np.all(center @ planes[:, :3].T + planes[:, 3] >= -reach, axis=1)


def _rolling_margin_px(camera: PinholeCamera) -> int:
    return _MARGIN_STEP_PX * max(round(camera.width_px / _WIDTH_PER_MARGIN / _MARGIN_STEP_PX), 1)


def _padded(camera: PinholeCamera, margin_px: int) -> PinholeCamera:
    """The camera with a margin around its image."""
    return replace(
        camera,
        width_px=camera.width_px + 2 * margin_px,
        height_px=camera.height_px + 2 * margin_px,
        cx_px=camera.cx_px + margin_px,
        cy_px=camera.cy_px + margin_px,
    )


def _planes(clip: Float64Array) -> Float64Array:
    """(6, 4) planes of a projection's volume, normals inward and of unit length."""
    planes: Float64Array = np.concatenate([clip[3] + clip[:3], clip[3] - clip[:3]])
    planes /= np.linalg.norm(planes[:, :3], axis=1, keepdims=True)
    return planes


def _clip_from_optical(camera: PinholeCamera) -> Float64Array:
    """(4, 4) projection from the intrinsics. Clip y grows downward, so that memory row 0 is the image's top row."""
    width, height = camera.width_px, camera.height_px
    return np.array(
        [
            [2.0 * camera.fx_px / width, 0.0, (2.0 * camera.cx_px + 1.0) / width - 1.0, 0.0],
            [0.0, 2.0 * camera.fy_px / height, (2.0 * camera.cy_px + 1.0) / height - 1.0, 0.0],
            [0.0, 0.0, (FAR_M + NEAR_M) / (FAR_M - NEAR_M), -2.0 * FAR_M * NEAR_M / (FAR_M - NEAR_M)],
            [0.0, 0.0, 1.0, 0.0],
        ]
    )


def _world_from_ego(world: WorldState, origin_m: Float64Array) -> Float64Array:
    pose: Float64Array = map_from_actors(world.ego.reshape(1))[0]
    pose[:3, 3] -= origin_m
    return pose
