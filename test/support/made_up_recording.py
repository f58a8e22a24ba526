"""A small recording of a flat street in the layout of nuScenes: a lidar that moves, a camera, and a parked car."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

CAR_M = (12.0, 3.0, 0.8)
"""Center of the car in the map, which is that of the ego at its first stamp; it is 4.2 m long and looks along y."""
PERIOD_S, SPEED_MPS = 0.25, 4.0
HEIGHT_M = 1.9
MATRIX = [[60.0, 0.0, 31.5], [0.0, 60.0, 23.5], [0.0, 0.0, 1.0]]


def ground_cloud(height_m: float = HEIGHT_M, ahead: float = 0.0, left: float = 0.0) -> np.ndarray[Any, Any]:
    """(N, 3) points of ground with slopes, and of a wall to the right, in the frame of a lidar above it."""
    rng = np.random.default_rng(5)
    x, y = rng.uniform(-25.0, 25.0, (2, 6000))
    wall = np.stack([rng.uniform(-20, 20, 1500), np.full(1500, -8.0), rng.uniform(-1.5, 3.0, 1500)], axis=1)
    return np.concatenate([np.stack([x, y, ahead * x + left * y - height_m], axis=1), wall])


def tables(keys: int = 2) -> dict[str, list[dict[str, Any]]]:
    """The tables: a turn of the lidar every quarter of a second, of which every second one is a key frame."""
    turned = _wxyz(Rotation.from_euler("z", -90, degrees=True))
    optical = _wxyz(Rotation.from_matrix([[0, 0, 1], [-1, 0, 0], [0, -1, 0]]))
    found: dict[str, list[dict[str, Any]]] = {
        "sensor": [{"token": "l", "channel": "LIDAR_TOP"}, {"token": "c", "channel": "CAM_FRONT"}],
        "calibrated_sensor": [
            {"token": "L", "sensor_token": "l", "translation": [1.0, 0.0, HEIGHT_M], "rotation": turned},
            {"token": "C", "sensor_token": "c", "translation": [1.5, 0.0, 1.5], "rotation": optical},
        ],
        "scene": [{"token": "scene", "name": "scene-0007"}],
        "category": [{"token": "k", "name": "vehicle.car"}],
        "instance": [{"token": "i", "category_token": "k"}],
        **{name: [] for name in ("sample", "sample_data", "ego_pose", "sample_annotation")},
    }
    for row, matrix in zip(found["calibrated_sensor"], ([], MATRIX), strict=True):
        row["camera_intrinsic"] = matrix
    for turn in range(2 * keys):
        sample, is_key = f"sample{turn // 2}", turn % 2 == 1
        position = [SPEED_MPS * PERIOD_S * turn, 0.0, 0.0]
        found["ego_pose"].append({"token": f"e{turn}", "translation": position, "rotation": [1.0, 0.0, 0.0, 0.0]})
        data = {"sample_token": sample, "ego_pose_token": f"e{turn}", "timestamp": 10**15 + turn * 250_000}
        kind = "samples" if is_key else "sweeps"
        files = [("L", f"{kind}/LIDAR_TOP/{turn}.pcd.bin")] + [("C", f"samples/CAM_FRONT/{turn}.jpg")] * is_key
        for token, name in files:
            found["sample_data"].append(
                {**data, "calibrated_sensor_token": token, "filename": name, "is_key_frame": is_key}
            )
        if is_key:
            found["sample"].append({"token": sample, "scene_token": "scene"})
            heading = _wxyz(Rotation.from_euler("z", 90, degrees=True))
            annotation = {"sample_token": sample, "instance_token": "i", "translation": list(CAR_M)}
            found["sample_annotation"].append({**annotation, "size": [1.8, 4.2, 1.6], "rotation": heading})
    return found


def write_nuscenes(folder: Path, keys: int = 2, version: str = "v1.0-mini") -> None:
    """Write tables, clouds and images."""
    import cv2

    made = tables(keys)
    (folder / version).mkdir(parents=True)
    for name, rows in made.items():
        (folder / version / f"{name}.json").write_text(json.dumps(rows))
    poses = {row["token"]: row["translation"] for row in made["ego_pose"]}
    for row in made["sample_data"]:
        path = folder / row["filename"]
        path.parent.mkdir(parents=True, exist_ok=True)
        if path.suffix == ".jpg":
            cv2.imwrite(str(path), np.full((48, 64, 3), 120, np.uint8))
            continue
        points = np.concatenate([ground_cloud(), _car_in_lidar(poses[row["ego_pose_token"]])])
        np.column_stack([points, np.zeros((len(points), 2))]).astype("<f4").tofile(path)


def _car_in_lidar(position: list[float]) -> np.ndarray[Any, Any]:
    """(N, 3) points in the car's box, in the frame of the turned lidar."""
    inside = np.random.default_rng(6).uniform(-0.5, 0.5, (200, 3)) * [1.8, 4.2, 1.6] + CAR_M
    ego = inside - position - [1.0, 0.0, HEIGHT_M]
    return np.stack([-ego[:, 1], ego[:, 0], ego[:, 2]], axis=1)


def _wxyz(rotation: Rotation) -> list[float]:
    x, y, z, w = rotation.as_quat().tolist()
    return [w, x, y, z]
