"""Coordinate frames of a scene, by their names in /tf and /tf_static.

From the calibration and the ego poses of a scene, ``ReferenceFrames`` computes the pose of each of its frames in the
map frame.
"""

from collections.abc import Callable, Mapping
from typing import Self

from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.scene import Scene
from simbev_ros.errors import InputError
from simbev_ros.evaluation.predictions.predicted_boxes import MAP_FRAME
from simbev_ros.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.scene.frames import base_link_frame, ego_frame, ego_from_base_link
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Float64Array


class ReferenceFrames:
    """Poses in the map frame, by tick and name of the coordinate frame, for ``predicted_boxes.boxes_in_map``.

    Args:
        spec: The scene.
        calibration: Calibration of its sensors, by name.
        map_from_ego: Gives the (4, 4) pose of the ego at a tick.

    Attributes:
        names: ``map``, ``<agent>/base_link``, ``<agent>/<sensor>`` and ``<agent>/<camera>_optical``; and
            ``<agent>/footprint``, the ego frame, if base_link is at the rear axle.
    """

    def __init__(
        self, spec: SceneSpec, calibration: Mapping[str, Calibration], map_from_ego: Callable[[int], Float64Array]
    ) -> None:
        agent = spec.rig.agent
        self._scene, self._map_from_ego = spec.name, map_from_ego
        self._fixed: dict[str, Float64Array | None] = {
            base_link_frame(agent): ego_from_base_link(spec),
            ego_frame(spec): None,
        }
        for name, each in calibration.items():
            if not each.sensor.has_frame:
                continue
            self._fixed[f"{agent}/{name}"] = each.ego_from_sensor
            if each.camera is not None:
                self._fixed[f"{agent}/{name}_optical"] = each.ego_from_sensor @ SENSOR_FROM_OPTICAL

    @classmethod
    def from_scene(cls, scene: Scene) -> Self:
        """Coordinate frames of a recorded scene."""
        return cls(scene.spec, scene.calibration, lambda tick: scene[tick].map_from_ego)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all coordinate frames."""
        return (MAP_FRAME, *self._fixed)

    def __call__(self, tick: int, frame_id: str) -> Float64Array:
        """(4, 4) map from a coordinate frame at a tick.

        Raises:
            InputError: There is no such coordinate frame.
        """
        if frame_id not in self._fixed:
            raise InputError(
                f"frame_id: there is no {frame_id!r} in scene {self._scene}; allowed: {', '.join(self.names)}"
            )
        map_from_ego, ego_from_frame = self._map_from_ego(tick), self._fixed[frame_id]
        return map_from_ego if ego_from_frame is None else map_from_ego @ ego_from_frame
