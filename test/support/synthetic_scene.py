"""A bag of a synthetic street with cars: every topic that a preview shows, in plausible form."""

from pathlib import Path

import numpy as np
from made_up_scene import made_up_spec
from ros_messages import compressed_image, image, odometry, point_cloud

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, Tag
from simbev_ros.foundation.types import AnyArray, Table
from simbev_ros.recording.bag_writer import SceneBagWriter
from simbev_ros.recording.layout import SCENE_ATTACHMENT
from simbev_ros.recording.qos import QosProfile
from simbev_ros.schema.boxes import blank_boxes
from simbev_ros.schema.scene.spec import SceneSpec

TICK_NS = 50_000_000
STEP_M = 0.5
YAWS_DEG = {"front_left": 55, "front": 0, "front_right": -55, "back_left": 110, "back": 180, "back_right": -110}
MODALITIES = ("rgb", "semantic", "instance", "depth", "flow")
ENCODINGS = {"rgb": "rgb8", "semantic": "mono8", "instance": "mono16", "depth": "32FC1", "flow": "32FC2"}

EGO_Y_M, CAMERA_Z_M = -1.9, 1.6
CAR_SIZE_M = np.array([4.6, 1.9, 1.5])
CARS_M = np.array([[16.3, -1.9, 0.95], [33.3, -1.9, 0.95], [-16.7, -1.9, 0.95], [10.3, 1.9, 0.95], [-6.7, 1.9, 0.95]])
"""Middles of the cars in the map; the first one has the id 2."""


def camera_images(ego_x_m: float, yaw_deg: float, width_px: int) -> dict[str, AnyArray]:
    """Images of a camera above the ego: a sky, a road and, where the cars are, rectangles."""
    height_px = width_px * 9 // 16
    camera = PinholeCamera.from_field_of_view(width_px, height_px, np.radians(80))
    v, u = np.mgrid[:height_px, :width_px]
    is_sky = v < height_px // 2
    depth_m = np.where(is_sky, np.inf, 90.0 * height_px / (v + 1) - 80.0).astype(np.float32)
    tags = np.where(is_sky, np.uint8(Tag.SKY), np.uint8(Tag.ROAD))
    ids = np.zeros((height_px, width_px), np.uint16)
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    map_from_optical = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    corners_m = CAR_SIZE_M * (np.indices((2, 2, 2)).reshape(3, 8).T - 0.5)
    for number, car_m in sorted(enumerate(CARS_M), key=lambda car: -abs(car[1][0])):
        optical_m = (car_m + corners_m - [ego_x_m, EGO_Y_M, CAMERA_Z_M]) @ map_from_optical
        if optical_m[:, 2].min() > 0.5:
            at_px = camera.project(optical_m)
            (left, top), (right, bottom) = np.floor(at_px.min(axis=0)), np.ceil(at_px.max(axis=0))
            inside = (u >= left) & (u <= right) & (v >= top) & (v <= bottom)
            depth_m[inside], tags[inside], ids[inside] = optical_m[:, 2].min(), Tag.CAR, 2 + number
    shades = np.stack([60 + u % 90, 90 + v % 60, 120 + (u + v) % 60], axis=-1) + 30 * (ids > 0)[..., None]
    flow = np.stack([u - width_px / 2, v - height_px / 2], axis=-1) / np.minimum(depth_m, 200.0)[..., None]
    return {"rgb": shades.astype(np.uint8), "semantic": tags, "instance": ids, "depth": depth_m} | {
        "flow": flow.astype(np.float32)
    }


def lidar_points() -> Table:
    """Points on the ground around the ego, with tags of a road and what is beside it."""
    kinds = [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("cos_angle", "<f4"), ("object_id", "<u4"), ("tag", "<u4")]
    points = np.zeros(4000, kinds)
    points["x"], points["y"] = np.random.default_rng(0).uniform(-60, 60, (2, 4000))
    points["z"] = -1.8
    beside_m = np.abs(points["y"] + EGO_Y_M)
    points["tag"] = np.select([beside_m < 3.8, beside_m < 6.2], [Tag.ROAD, Tag.SIDEWALK], Tag.VEGETATION)
    return points


def radar_points(yaw_deg: float) -> Table:
    """Points that stand still, seen by a radar that moves with the ego."""
    rng = np.random.default_rng(0)
    azimuth_rad, range_m = np.radians(rng.uniform(-50, 50, 2000)), rng.uniform(3, 100, 2000)
    points = np.zeros(2000, [(name, "<f4") for name in ("x", "y", "z", "doppler_velocity")])
    points["x"], points["y"] = range_m * np.cos(azimuth_rad), range_m * np.sin(azimuth_rad)
    points["doppler_velocity"] = -STEP_M / TICK_NS * 1e9 * np.cos(azimuth_rad + np.radians(yaw_deg))
    return points


def bev_labels(ego_x_m: float, cells: int = 360, cell_m: float = 0.4) -> AnyArray:
    """The road along x, sidewalks and cars."""
    axis_m = ((cells - 1) / 2 - np.arange(cells)) * cell_m
    x_m, y_m = axis_m[:, None] + ego_x_m, axis_m[None, :] + EGO_Y_M
    bit = {name: np.uint16(1 << k) for k, name in enumerate(BEV_CLASSES)}
    labels = np.where(np.abs(y_m) < 3.8, bit["road"], np.where(np.abs(y_m) < 6.2, bit["sidewalk"], 0)) + 0 * x_m
    labels = labels.astype(np.uint16)
    for car_m in CARS_M:
        labels[(abs(x_m - car_m[0]) < CAR_SIZE_M[0] / 2) & (abs(y_m - car_m[1]) < CAR_SIZE_M[1] / 2)] |= bit["car"]
    return labels


def box_table() -> Table:
    """Rows of /ego/boxes; columns that are not known here are blank."""
    rows = blank_boxes(len(CARS_M))
    rows["x"], rows["y"], rows["z"] = CARS_M.T
    rows["length"], rows["width"], rows["height"] = CAR_SIZE_M
    rows["class"] = BOX_CLASSES.index("car")
    return rows


def street_spec(ticks: int, width_px: int) -> SceneSpec:
    """The scene of the street, with all its sensors."""
    size = {"width_px": width_px, "height_px": width_px * 9 // 16}
    cameras = [
        {"type": "camera", "name": f"cam_{name}", "pose": {"z_m": 1.6, "yaw_deg": yaw_deg}, **size}
        for name, yaw_deg in YAWS_DEG.items()
    ]
    radars = [
        {"type": "radar", "name": f"radar_{name}", "pose": {"x_m": x_m, "z_m": 0.6, "yaw_deg": YAWS_DEG[name]}}
        for name, x_m in (("front", 2.4), ("back", -2.4))
    ]
    lidar = {"type": "lidar", "name": "lidar", "pose": {"z_m": 1.8}}
    return made_up_spec([*cameras, lidar, *radars], ticks=ticks, grid=(360, 360))


START_NS = street_spec(1, 96).start_ns


def write_scene(
    path: Path,
    *,
    ticks: int = 3,
    width_px: int = 96,
    cameras: tuple[str, ...] = tuple(YAWS_DEG),
    modalities: tuple[str, ...] = MODALITIES,
    compressed: bool = True,
    from_above: bool = True,
    radars: tuple[str, ...] = (),
    boxes: bool = False,
    attachments: dict[str, bytes] | None = None,
) -> Path:
    """Write the bag; modalities other than rgb are written for the front camera only.

    The rig has all sensors of the street. ``attachments`` replace the scene's specification.
    """
    if attachments is None:
        attachments = {SCENE_ATTACHMENT: street_spec(ticks, width_px).model_dump_json().encode()}
    make = compressed_image if compressed else image
    with SceneBagWriter(path) as writer:
        for name, data in attachments.items():
            writer.add_attachment(name, "application/json", data)
        topics: set[str] = set()

        def write(topic: str, type_name: str, stamp_ns: int, data: bytes) -> None:
            if topic not in topics:
                package = "nav_msgs" if type_name == "Odometry" else "sensor_msgs"
                writer.add_topic(topic, f"{package}/msg/{type_name}", QosProfile())
                topics.add(topic)
            writer.write(topic, stamp_ns, data)

        for tick in range(ticks):
            stamp_ns, ego_x_m = START_NS + tick * TICK_NS, tick * STEP_M
            for camera in cameras:
                images = camera_images(ego_x_m, YAWS_DEG[camera], width_px)
                for modality in modalities if camera == "front" else ("rgb",):
                    form = ("/compressedDepth" if modality == "depth" else "/compressed") if compressed else ""
                    topic = f"/ego/cam_{camera}/{modality}/image_raw{form}"
                    data = make(stamp_ns, ENCODINGS[modality], images[modality])
                    write(topic, "CompressedImage" if compressed else "Image", stamp_ns, data)
            if from_above:
                write("/ego/lidar/semantic_points", "PointCloud2", stamp_ns, point_cloud(stamp_ns, lidar_points()))
                write("/ego/bev/labels", "Image", stamp_ns, image(stamp_ns, "mono16", bev_labels(ego_x_m)))
            for radar in radars:
                cloud = point_cloud(stamp_ns, radar_points(YAWS_DEG[radar]))
                write(f"/ego/radar_{radar}/points", "PointCloud2", stamp_ns, cloud)
            if boxes:
                write("/ego/boxes", "PointCloud2", stamp_ns, point_cloud(stamp_ns, box_table()))
                pose = odometry(stamp_ns, np.array([ego_x_m, EGO_Y_M, 0.0]), np.zeros(3))
                write("/ego/odom", "Odometry", stamp_ns, pose)
        return writer.finish({"scene": path.name})
