"""Frames of reference of a scene: those of /tf and /tf_static, by their names there."""

from collections.abc import Callable, Mapping
from typing import Self

from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.scene import Scene
from simbev_ros.errors import InputError
from simbev_ros.evaluation.predictions.predicted_boxes import MAP_FRAME
from simbev_ros.geometry.transforms import SENSOR_FROM_OPTICAL
from simbev_ros.scene.spec import SceneSpec
from simbev_ros.types import Float64Array


class ReferenceFrames:
    """Poses in the map frame, by tick and name: what ``predicted_boxes.in_map`` asks for.

    Args:
        spec: The scene.
        calibration: Of its sensors, by name.
        map_from_ego: Gives the (4, 4) pose of the ego at a tick.

    Attributes:
        names: ``map``, ``<agent>/base_link``, ``<agent>/<sensor>`` and ``<agent>/<camera>_optical``.
    """

    def __init__(
        self, spec: SceneSpec, calibration: Mapping[str, Calibration], map_from_ego: Callable[[int], Float64Array]
    ) -> None:
        agent = spec.rig.agent
        self._scene, self._map_from_ego = spec.name, map_from_ego
        self._fixed: dict[str, Float64Array | None] = {f"{agent}/base_link": None}
        for name, each in calibration.items():
            self._fixed[f"{agent}/{name}"] = each.ego_from_sensor
            if each.camera is not None:
                self._fixed[f"{agent}/{name}_optical"] = each.ego_from_sensor @ SENSOR_FROM_OPTICAL

    @classmethod
    def of(cls, scene: Scene) -> Self:
        """Those of a recorded scene."""
        return cls(scene.spec, scene.calibration, lambda tick: scene[tick].map_from_ego)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all frames of reference."""
        return (MAP_FRAME, *self._fixed)

    def __call__(self, tick: int, frame_id: str) -> Float64Array:
        """(4, 4) map from a frame of reference at a tick.

        Raises:
            InputError: There is no such frame of reference.
        """
        if frame_id not in self._fixed:
            raise InputError(
                f"frame_id: there is no {frame_id!r} in scene {self._scene}; allowed: {', '.join(self.names)}"
            )
        map_from_ego, ego_from_frame = self._map_from_ego(tick), self._fixed[frame_id]
        return map_from_ego if ego_from_frame is None else map_from_ego @ ego_from_frame
