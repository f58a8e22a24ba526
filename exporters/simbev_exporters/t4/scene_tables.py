"""The tables of one scene as T4 has them, and the files of its sensors: all poses are about Autoware's base_link.

That is the middle of the rear axle on the ground, x forward, y left, z up; of a roadside unit it is its ego frame.
The clouds of all lidars are one channel, LIDAR_CONCAT, in that frame.
"""

import base64
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from pycocotools import mask as run_lengths

from simbev_exporters.nuscenes.channel_records import calibration_record, sensor_record
from simbev_exporters.nuscenes.lidarseg import frame_labels, semantic_key
from simbev_exporters.nuscenes.scene_tables import SceneTables, captured_at, stamp_us
from simbev_exporters.nuscenes.sensor_files import encode_file, lidar_rows
from simbev_exporters.nuscenes.taxonomy import Record, sample_data_token, token
from simbev_exporters.t4.annotations import T4Annotations, name_tables, t4_labels
from simbev_ros.dataset import Frame, Scene
from simbev_ros.dataset.calibration import Calibration
from simbev_ros.dataset.nuscenes.channels import TOP_LIDAR, Channel, ChannelNames, Modality, channels_of
from simbev_ros.dataset.nuscenes.keyframes import keyframes_of
from simbev_ros.dataset.values import poses_from_odometry
from simbev_ros.foundation.geometry.transforms import apply, inverse, matrices_from_xyz_rpy
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.frames import rear_axle_m
from simbev_ros.schema.scene.state import Light

CONCAT_LIDAR = "LIDAR_CONCAT"
_NO_DISTORTION = [0.0] * 5
_KMPH_PER_MPS = 3.6


class T4Tables(SceneTables):
    """The tables of a scene and its sensors' files, with paths relative to the scene's dataset.

    Args:
        scene: The scene.
        keyframe_hz: Number of samples per second; None: every frame is one.
        names: Channels of sensors with other names than by default, ``channels_of``.
        write: Receives the path of each file and its content.
        keep_unhit: Whether boxes without lidar and radar points are annotated.
        lidarseg: Whether to write the categories of lidar points, if semantic clouds of all lidars were recorded.

    Raises:
        InputError: The rate does not divide that of the frames.
        BagError: The bag is damaged or lacks data that the tables need.
    """

    file_formats: ClassVar[Mapping[Modality, str]] = {"camera": "jpg", "lidar": "pcd.bin", "radar": "pcd"}

    def __init__(
        self,
        scene: Scene,
        keyframe_hz: float | None,
        names: ChannelNames,
        write: Callable[[str, bytes], None],
        *,
        keep_unhit: bool,
        lidarseg: bool,
    ) -> None:
        channels = channels_of(scene, names)
        self._lidars = [channel for channel in channels if channel.modality == "lidar"]
        exported = [channel for channel in channels if channel not in self._lidars]
        exported[:0] = [replace(each, name=CONCAT_LIDAR) for each in self._lidars if each.name == TOP_LIDAR]
        self._t4_annotations = T4Annotations(scene, keep_unhit=keep_unhit)
        ticks = keyframes_of(scene, keyframe_hz)
        super().__init__(scene, ticks, exported, self._t4_annotations, write, sweeps=False)
        self._number = {tick: number for number, tick in enumerate(ticks.tolist())}
        self._ego_from_base = ego_from_base_link(scene)
        self._labels: list[Record] = []
        self._has_labels = lidarseg and all(semantic_key(each) in scene.sources for each in self._lidars)
        self._views: list[Record] = []
        self._states: list[Record] = []

    def add(self, frame: Frame) -> None:
        """Write the files of the next frame and collect its rows."""
        super().add(frame)
        if frame.tick in self._number:
            self._views += self._object_annotations(frame)
            if self._has_labels:
                self._labels += self._point_labels(frame)
            if self._scene.view.vehicle is not None:
                self._states.append(self._vehicle_state(frame))

    def tables(self) -> dict[str, list[Record]]:
        """All rows of all tables, by name of the table; those of 2D annotations only if there are instance images."""
        rows, logs = super().tables(), [token("log", self._token)]
        rows["sample_data"] = [{**row, "is_valid": True} for row in rows["sample_data"]]
        return {
            **rows,
            **name_tables(lidarseg=bool(self._labels)),
            "sensor": [sensor_record(channel) for channel in self._channels],
            "map": [{"token": token("map", self._token), "log_tokens": logs, "category": "", "filename": ""}],
            "vehicle_state": self._states,
            **({"object_ann": self._views} if self._views else {}),
            **({"lidarseg": self._labels} if self._labels else {}),
        }

    def _file(self, channel: Channel, frame: Frame, keyframe: int | None) -> str:
        assert keyframe is not None, "only keyframes are written"
        return f"data/{channel.name}/{self._number[keyframe]:05d}.{self.file_formats[channel.modality]}"

    def _content(self, channel: Channel, frame: Frame) -> bytes:
        if channel.modality != "lidar":
            return encode_file(frame, channel)
        clouds = []
        for lidar in self._lidars:
            if lidar.key in frame:
                rows = lidar_rows(frame, lidar)
                rows[:, :3] = apply(self._base_from(lidar.calibration.ego_from_sensor), rows[:, :3].astype(np.float64))
                clouds.append(rows)
        return np.concatenate(clouds).tobytes()

    def _pose(self, frame: Frame) -> Record:
        row = frame["odom"][-1]
        arm_m = self._ego_from_base[:3, 3]
        rate = row["angular_velocity_radps"]
        velocity_mps = row["velocity_mps"] + np.cross(rate, arm_m)
        map_from_base = poses_from_odometry(row) @ self._ego_from_base
        return {
            **super()._pose(frame),
            "translation": map_from_base[:3, 3].tolist(),
            "twist": [*velocity_mps.tolist(), *rate[::-1].tolist()],
        }

    def _calibration(self, channel: Channel) -> Record:
        pose = np.eye(4) if channel.modality == "lidar" else self._base_from(channel.ego_from_channel)
        distortion = _NO_DISTORTION if channel.modality == "camera" else []
        return {**calibration_record(channel, self._token, pose), "camera_distortion": distortion}

    def _log(self, log: str) -> Record:
        vehicle, scene = self._scene.view.vehicle, self._scene
        return {
            "token": log,
            "logfile": scene.name,
            "vehicle": scene.agent if vehicle is None else vehicle.blueprint,
            "data_captured": f"{captured_at(scene):%Y-%m-%d-%H-%M-%S}",
            "location": scene.map,
        }

    def _base_from(self, ego_from_frame: Float64Array) -> Float64Array:
        return np.asarray(inverse(self._ego_from_base) @ ego_from_frame, np.float64)

    def _vehicle_state(self, frame: Frame) -> Record:
        """Row of the table ``vehicle_state`` of a frame."""
        ego = self._scene.view.ego_row(frame["world/actors"])
        lights = int(ego["lights"])
        left, right = bool(lights & Light.TURN_LEFT), bool(lights & Light.TURN_RIGHT)
        lit = {"left": left, "right": right, "hazard": left and right}
        speed_mps = float(frame["odom"][-1]["velocity_mps"][0])
        return {
            "token": token("vehicle_state", self._token, frame.tick),
            "timestamp": stamp_us(frame),
            "steering_tire_angle": float(ego["steer"]),
            "shift_state": "REVERSE" if lights & Light.REVERSE else "FORWARD",
            "indicators": {name: "on" if is_on else "off" for name, is_on in lit.items()},
            "additional_info": {"speed": speed_mps * _KMPH_PER_MPS},
        }

    def _point_labels(self, frame: Frame) -> Iterator[Record]:
        """Row of the table ``lidarseg`` of a frame with a whole cloud, of which the labels are written."""
        seen = [lidar for lidar in self._lidars if lidar.key in frame]
        if seen and all(semantic_key(lidar) in frame for lidar in seen):
            data = sample_data_token(self._token, CONCAT_LIDAR, frame.tick)
            file = f"lidarseg/annotation/{data}.bin"
            self._write_file(file, t4_labels(np.concatenate([frame_labels(frame, each) for each in seen])).tobytes())
            yield {"token": data, "sample_data_token": data, "filename": file}

    def _object_annotations(self, frame: Frame) -> Iterator[Record]:
        """Rows of the table ``object_ann`` of a frame: annotated objects with a visible pixel in an image."""
        attributes = self._t4_annotations.attributes_at(self._sample_token(frame.tick))
        for channel in self._channels:
            name = channel.key.partition("/")[0]
            keys = f"{name}/boxes", f"{name}/instance"
            if channel.modality == "camera" and _is_pinhole(channel.calibration) and all(key in frame for key in keys):
                data = sample_data_token(self._token, channel.name, frame.tick)
                instances = frame[keys[1]]
                for view in frame[keys[0]]:
                    box_id = int(view["id"])
                    if box_id in attributes and view["visible_px"] > 0:
                        yield {
                            "token": token("object_ann", data, box_id),
                            "sample_data_token": data,
                            **self._t4_annotations.keys_of(box_id),
                            "attribute_tokens": attributes[box_id],
                            "bbox": _amodal_box(view, instances.shape),
                            "mask": _mask(instances == box_id),
                        }


def ego_from_base_link(scene: Scene) -> Float64Array:
    """(4, 4) pose of Autoware's base_link in the ego frame."""
    x_m = 0.0 if scene.view.vehicle is None else -rear_axle_m(scene.view)
    return matrices_from_xyz_rpy(np.array([x_m, 0.0, 0.0]), np.zeros(3))


def _is_pinhole(calibration: Calibration) -> bool:
    """Whether a camera's images are exported as they were recorded, so that instance images fit them."""
    return not np.any(calibration.distortion)


def _amodal_box(view: np.void, shape: tuple[int, int]) -> list[int]:
    """Minimum x and y, maximum x and y of an object's whole silhouette within the image; a pixel is from 0 to 1."""
    height_px, width_px = shape
    edges_px = [view[f"amodal_{side}"] + 0.5 for side in ("left", "top", "right", "bottom")]
    limits_px = [width_px, height_px, width_px, height_px]
    return [int(np.clip(round(float(edge)), 0, limit)) for edge, limit in zip(edges_px, limits_px, strict=True)]


def _mask(mask: np.ndarray) -> Record:
    """Run lengths of an (H, W) mask as T4 has them: of the transposed image, in base 64."""
    shape = run_lengths.encode(np.asfortranarray(mask.T, np.uint8))
    return {"size": list(map(int, shape["size"])), "counts": base64.b64encode(shape["counts"]).decode("ascii")}
