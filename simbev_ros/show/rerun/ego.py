"""Draws the ego: its pose, its mesh, the poses of its sensors, and the path that it has driven."""

import numpy as np
import rerun as rr

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.foundation.types import Float64Array
from simbev_ros.show.rerun.scene_log import EGO, WORLD, SceneLog
from simbev_ros.show.rerun.strokes import LINE
from simbev_ros.show.rerun.subject import Samples, Subject

_PATH_COLOR = (255, 196, 60)
_MAX_PATH_POINTS = 2000
_FRUSTUM_M = 1.2
"""Distance at which the frustum of a camera is drawn."""


class EgoDrawing:
    """Draws the ego; what does not change is logged at once."""

    def __init__(self, log: SceneLog, subject: Subject) -> None:
        self._log, self._path_m = log, [np.zeros(3)][:0]
        log.add_static(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP)
        _draw_mesh(log, subject)
        _draw_sensors(log, subject)

    def draw(self, samples: Samples) -> None:
        """Log the pose and the path."""
        if "odom" not in samples:
            return
        map_from_ego: Float64Array = poses_from_odometry(samples["odom"][-1])
        self._path_m = [*self._path_m, map_from_ego[:3, 3]][-_MAX_PATH_POINTS:]
        self._log.add(EGO, rr.Transform3D(translation=map_from_ego[:3, 3], mat3x3=map_from_ego[:3, :3]))
        if len(self._path_m) > 1:
            self._log.add(f"{WORLD}/path", rr.LineStrips3D([self._path_m], colors=_PATH_COLOR, radii=LINE))


def _draw_mesh(log: SceneLog, subject: Subject) -> None:
    vehicle = subject.view.vehicle
    if vehicle is None:  # a roadside unit has no body
        return
    mesh = next(model.mesh for model in load_models() if model.blueprint == vehicle.blueprint)
    log.add_static(
        f"{EGO}/body",
        rr.Mesh3D(
            vertex_positions=mesh.vertices,
            triangle_indices=mesh.triangles,
            vertex_normals=mesh.normals,
            vertex_colors=mesh.color,
        ),
    )


def _draw_sensors(log: SceneLog, subject: Subject) -> None:
    for name, calibration in subject.calibration.items():
        entity, camera = f"{EGO}/{name}", calibration.camera
        if camera is None:
            pose = calibration.ego_from_sensor
            log.add_static(entity, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
            continue
        pose = calibration.ego_from_optical
        # Pixel centers are at integers here, and at halves in Rerun.
        step = subject.image_step(name)
        shift = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, 0.5], [0.0, 0.0, 1.0]])
        image_from_camera = np.diag([1.0 / step, 1.0 / step, 1.0]) @ shift @ camera.matrix
        log.add_static(
            entity,
            rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]),
            rr.Pinhole(
                image_from_camera=image_from_camera,
                resolution=[len(range(step // 2, side_px, step)) for side_px in (camera.width_px, camera.height_px)],
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=_FRUSTUM_M,
            ),
        )
