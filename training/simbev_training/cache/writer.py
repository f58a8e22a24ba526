"""Writes the cache of a dataset, scene by scene; scenes that are there already, from the same bag, are left alone."""

import json
import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import simplejpeg

from simbev_ros.baselines.boxes import DETECTED_CLASSES
from simbev_ros.baselines.frames import IMAGE_STRIDE
from simbev_ros.baselines.grid import CELL_M, CELLS, level_from_map
from simbev_ros.baselines.modality import Modality
from simbev_ros.config.lidar import Lidar
from simbev_ros.dataset import columns, open_dataset
from simbev_ros.dataset.frame import Frame
from simbev_ros.dataset.parallel import Pool
from simbev_ros.dataset.scene import Scene
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.fisheye import FisheyeCamera
from simbev_ros.foundation.object_store.object_path import AnyPath
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
from simbev_training.cache.layout import (
    BOX_DTYPE,
    CM_PER_M,
    FORMAT,
    FRAME_DTYPE,
    MAX_POINT_M,
    SCENE_FILE,
    SWEEP_DTYPE,
)

_DEPTH_LIMIT_M = 655.0
_JPEG_QUALITY = 90


def write_cache(
    dataset: AnyPath,
    cache: Path,
    pool: Pool,
    modality: Modality = Modality.FUSED,
    lidar: str = "lidar",
    agent: str | None = None,
) -> Iterator[tuple[int, int]]:
    """Write all finished scenes of a dataset; yield the number of scenes that are done and of all.

    Args:
        dataset: The dataset.
        cache: Folder of the cache, new or begun.
        pool: Processes that do it.
        modality: What models see. For those that see no images, a scene's cameras need not suit.
        lidar: Name of the lidar that models see.
        agent: Agent whose data models see; None: the first one of each scene.

    Raises:
        InputError: No scene has the agent, or the rig or the grid of a scene does not suit the models.
        BagError: A bag is damaged.
    """
    opened = open_dataset(dataset, threads=1)
    scenes = (opened if agent is None else opened.of_agent(agent)).scenes
    missing = [scene for scene in scenes if not _is_written(cache, scene, modality)]
    done = len(scenes) - len(missing)
    yield done, len(scenes)
    for _ in pool.map(partial(write_scene, cache=cache, modality=modality, lidar=lidar), missing):
        done += 1
        yield done, len(scenes)


def scene_folder(cache: Path, scene: Scene) -> Path:
    """Folder of a scene."""
    return cache / scene.split / scene.name


def _is_written(cache: Path, scene: Scene, modality: Modality) -> bool:
    """Whether the cache has a scene: from its bag, of its agent, in the present format, with images if needed."""
    try:
        about = parse_json((scene_folder(cache, scene) / SCENE_FILE).read_bytes())
        made_from = [about.get(name) for name in ("format", "sha256", "agent")]
    except (OSError, *FOREIGN_ERRORS):
        return False
    is_sufficient = bool(about.get("cameras")) or not modality.has_cameras
    return is_sufficient and made_from == [FORMAT, scene.row.get("sha256"), scene.chosen_agent]


def write_scene(scene: Scene, cache: Path, modality: Modality, lidar: str) -> None:
    """Write one scene; the folder gets its name when it is complete. Arguments and errors as for ``write_cache``."""
    folder = scene_folder(cache, scene)
    making = folder.with_name(f".{folder.name}")
    cameras = _cameras(scene, modality)
    arrays = _arrays(scene, cameras, lidar)
    shutil.rmtree(making, ignore_errors=True)
    making.mkdir(parents=True)
    for name, array in arrays.items():
        np.save(making / f"{name}.npy", array)
    width_px, height_px = scene.calibration[cameras[0]].size_px if cameras else (0, 0)
    about = {
        "format": FORMAT,
        "sha256": scene.row.get("sha256"),
        "agent": scene.chosen_agent,
        "name": scene.name,
        "map": scene.map,
        "split": scene.split,
        "cameras": cameras,
        "width_px": width_px,
        "height_px": height_px,
        "lidar_m": scene.calibration[lidar].ego_from_sensor[:3, 3].tolist(),
        "ring_deg": _ring_deg(scene, lidar),
        "weather": scene.weather.model_dump(),
    }
    (making / SCENE_FILE).write_text(json.dumps(about, indent=1), encoding="utf-8")
    shutil.rmtree(folder, ignore_errors=True)
    making.rename(folder)


def _arrays(scene: Scene, cameras: list[str], lidar: str) -> dict[str, AnyArray]:
    """The arrays of a scene by the stems of their files."""
    keys = [
        "bev/labels",
        "boxes",
        f"{lidar}/points",
        *(f"{name}/{kind}" for name in cameras for kind in ("rgb", "depth")),
    ]
    for key in keys:
        if key not in scene.keys:
            raise InputError(f"{scene.path}: has no {key}; the baselines need {', '.join(keys)}")
    sweep_ticks = np.flatnonzero(scene.has([f"{lidar}/points"]))
    sweeps = np.zeros(len(sweep_ticks), SWEEP_DTYPE)
    points, ends = [np.zeros((0, 3), np.int16)], 0
    for sweep, tick in zip(sweeps, sweep_ticks, strict=True):
        frame = scene[int(tick)]
        points.append(_points_cm(frame, lidar, scene.calibration[lidar].ego_from_sensor))
        ends += len(points[-1])
        sweep["stamp_ns"], sweep["map_from_ego"], sweep["points_end"] = frame.stamp_ns, frame.map_from_ego, ends
    ticks = np.flatnonzero(scene.has(keys))
    frames = np.zeros(len(ticks), FRAME_DTYPE)
    images, image_ends, depth, cells, boxes = [], [], [], [], [np.zeros(0, BOX_DTYPE)]
    size = boxes_end = 0
    for row, tick in zip(frames, ticks, strict=True):
        frame = scene[int(tick)]
        jpegs = [_jpeg(frame, name) for name in cameras]
        images += jpegs
        image_ends.append(size + np.cumsum([len(each) for each in jpegs], dtype=np.int64))
        size += sum(map(len, jpegs))
        depth.append([_patch_depth_cm(frame[f"{name}/depth"]) for name in cameras])
        cells.append(_cells(scene, frame))
        boxes.append(_boxes(frame))
        boxes_end += len(boxes[-1])
        row["tick"], row["stamp_ns"], row["map_from_ego"] = tick, frame.stamp_ns, frame.map_from_ego
        row["boxes_end"] = boxes_end
    projection = [_pixel_from_ego(scene, name) for name in cameras]
    return {
        "frames": frames,
        "sweeps": sweeps,
        "points": np.concatenate(points),
        "images": np.frombuffer(b"".join(images), np.uint8),
        "image_ends": np.array(image_ends, np.int64).reshape(len(frames), len(cameras)),
        "depth": np.array(depth, np.uint16),
        "cells": np.array(cells, np.uint16).reshape(len(frames), CELLS, CELLS),
        "boxes": np.concatenate(boxes),
        "pixels": np.array(projection, np.float64).reshape(len(cameras), 3, 4),
    }


def _cameras(scene: Scene, modality: Modality) -> list[str]:
    """Names of the cameras with images in color and depth; none if they do not suit and a model sees none.

    Raises:
        InputError: A model with cameras cannot use them.
    """
    names = [name for name in scene.calibration if f"{name}/rgb" in scene.keys and f"{name}/depth" in scene.keys]
    problem = _problem_of(scene, names)
    if problem and modality.has_cameras:
        raise InputError(f"{scene.path}: {problem}")
    return [] if problem else names


def _problem_of(scene: Scene, cameras: list[str]) -> str:
    """Why models cannot use these cameras; empty if they can."""
    for name in cameras:
        calibration = scene.calibration[name]
        width_px, height_px = calibration.size_px
        if calibration.size_px != scene.calibration[cameras[0]].size_px or width_px % 16 or height_px % 16:
            return (
                f"camera {name}: has {width_px} x {height_px} pixels; "
                "all cameras must have the same size, a multiple of 16"
            )
        if isinstance(calibration.camera, LensCamera | FisheyeCamera):
            return f"camera {name}: has a distorting lens; the baselines need an ideal one"
    return "" if cameras else "has no camera with the modalities rgb and depth; a baseline that sees images needs one"


def _ring_deg(scene: Scene, lidar: str) -> float:
    """Angle between two rings of a lidar; 0 if it is not always the same."""
    [sensor] = [each for each in scene.view.rig.of_type(Lidar) if each.name == lidar]
    if sensor.elevations_deg is not None or sensor.rosette is not None:
        return 0.0
    return (sensor.upper_fov_deg - sensor.lower_fov_deg) / max(sensor.channels - 1, 1)


def _points_cm(frame: Frame, lidar: str, ego_from_sensor: Float64Array) -> AnyArray:
    """(N, 3) int16 points of a sweep, cm, ego frame."""
    points = columns(frame[f"{lidar}/points"], "x", "y", "z").astype(np.float64)
    points = points[np.isfinite(points).all(1)] @ ego_from_sensor[:3, :3].T + ego_from_sensor[:3, 3]
    points = points[(np.abs(points) < MAX_POINT_M).all(1)]
    return np.rint(points * CM_PER_M).astype(np.int16)


def _jpeg(frame: Frame, camera: str) -> bytes:
    """A camera's image as JPEG: as recorded, or encoded if it was not compressed."""
    message = frame.messages(f"{camera}/rgb")[-1]
    if "jpeg" in getattr(message, "format", ""):
        return bytes(message.data)
    return bytes(simplejpeg.encode_jpeg(np.ascontiguousarray(frame[f"{camera}/rgb"]), _JPEG_QUALITY, "RGB"))


def _patch_depth_cm(depth_m: AnyArray) -> AnyArray:
    """(H / 8, W / 8) uint16 smallest depth of each patch of an (H, W) image."""
    height, width = depth_m.shape
    patches = depth_m.reshape(height // IMAGE_STRIDE, IMAGE_STRIDE, width // IMAGE_STRIDE, IMAGE_STRIDE)
    nearest = np.where(np.isfinite(patches), patches, np.inf).min(axis=(1, 3))
    return np.where(nearest < _DEPTH_LIMIT_M, nearest * CM_PER_M, 0.0).astype(np.uint16)


def _cells(scene: Scene, frame: Frame) -> AnyArray:
    bev = scene.view.annotation.bev
    cells = frame["bev/labels"]
    if bev is None or (bev.rows, bev.columns, bev.cell_m) != (CELLS, CELLS, CELL_M):
        raise InputError(f"{scene.path}: annotation.bev: the baselines need {CELLS} x {CELLS} cells of {CELL_M} m")
    return np.asarray(cells)


def _boxes(frame: Frame) -> Table:
    """(B,) ``BOX_DTYPE`` boxes of a frame."""
    table = frame["boxes"]
    table = table[table["class"] < len(DETECTED_CLASSES)]
    level = level_from_map(frame.map_from_ego)
    result = np.zeros(len(table), BOX_DTYPE)
    for name in ("length", "width", "height", "visibility", "class"):
        result[name] = table[name]
    center = columns(table, "x", "y", "z") @ level[:3, :3].T + level[:3, 3]
    velocity = columns(table, "vx", "vy", "vz").astype(np.float64) @ level[:3, :3].T
    result["x"], result["y"], result["z"] = center.T
    result["vx"], result["vy"] = velocity[:, :2].T
    heading_rad = np.arctan2(level[1, 0], level[0, 0])
    result["yaw"] = np.angle(np.exp(1j * (table["yaw"] + heading_rad)))
    result["points"] = table["lidar_points"].clip(0) + table["radar_points"].clip(0)
    return result


def _pixel_from_ego(scene: Scene, camera: str) -> Float64Array:
    """(3, 4) projection of a camera."""
    calibration = scene.calibration[camera]
    optical_from_ego = np.linalg.inv(calibration.ego_from_optical)
    return np.asarray(calibration.intrinsics @ optical_from_ego[:3])
