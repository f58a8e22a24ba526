"""A bag of a synthetic street of boxes, ray-cast in numpy: every topic that a preview shows, in plausible form."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from made_up_scene import made_up_spec
from ros_messages import compressed_image, image, odometry, point_cloud

from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.semantics import BEV_CLASSES, BOX_CLASSES, Tag
from simbev_ros.foundation.types import AnyArray, Float64Array, Table
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

_TINT = {
    Tag.ROAD: (92, 94, 98),
    Tag.ROAD_LINE: (230, 230, 225),
    Tag.SIDEWALK: (165, 160, 150),
    Tag.TERRAIN: (96, 128, 70),
    Tag.BUILDING: (190, 170, 150),
    Tag.VEGETATION: (60, 105, 52),
    Tag.CAR: (60, 110, 180),
    Tag.TRUCK: (210, 205, 195),
    Tag.PEDESTRIAN: (200, 90, 60),
}


@dataclass(frozen=True)
class Street:
    """(N, 3) lower and upper corners of boxes in the map frame, meters; (N,) tags and ids."""

    low: Float64Array
    high: Float64Array
    tags: AnyArray
    ids: AnyArray


def street(seed: int = 0) -> Street:
    rng = np.random.default_rng(seed)
    rows = []
    for side in (-1, 1):
        for x in np.arange(-80, 120, 17.0):
            rows.append((x, side * 14 - 3, 0, x + 13, side * 14 + 3, rng.uniform(6, 16), Tag.BUILDING, 0))
        for x in np.arange(-72, 110, 11.0):
            rows.append((x, side * 7.5 - 0.8, 2.2, x + 1.8, side * 7.5 + 0.8, 4.6, Tag.VEGETATION, 0))
        for k, x in enumerate(rng.uniform(-60, 80, 7)):
            y = side * rng.uniform(4.6, 5.6)
            rows.append((x, y, 0.1, x + 0.5, y + 0.5, 1.8, Tag.PEDESTRIAN, 20 + k + 10 * (side > 0)))
    for k, x in enumerate((14, 31, -19, 60, -40, 8, -9, 24)):
        y, truck = (-1.9, False) if k < 5 else (1.9, k == 7)
        size = (7.0, 2.4, 3.1) if truck else (4.6, 1.9, 1.5)
        tag = Tag.TRUCK if truck else Tag.CAR
        rows.append((x, y - size[1] / 2, 0.2, x + size[0], y + size[1] / 2, size[2], tag, 2 + k))
    table = np.array(rows, np.float64)
    return Street(table[:, :3], table[:, 3:6], table[:, 6].astype(np.uint8), table[:, 7].astype(np.uint16))


def cast(scene: Street, origin: Float64Array, rays: Float64Array) -> tuple[Float64Array, AnyArray, AnyArray, AnyArray]:
    """Distances in ray lengths (inf: sky), tags, ids and shades in 0..1 for (N, 3) rays."""
    with np.errstate(divide="ignore", invalid="ignore"):
        t_m = np.where(rays[:, 2] < 0, -origin[2] / rays[:, 2], np.inf)
        y_m = np.abs(origin[1] + t_m * rays[:, 1])
    x_m = np.where(np.isfinite(t_m), origin[0] + t_m * rays[:, 0], 0)
    tags = np.select(
        [~np.isfinite(t_m), (y_m < 0.08) & (x_m % 6 < 3), y_m < 3.8, y_m < 6.2],
        [Tag.SKY, Tag.ROAD_LINE, Tag.ROAD, Tag.SIDEWALK],
        Tag.TERRAIN,
    ).astype(np.uint8)
    ids, shade = np.zeros(len(rays), np.uint16), np.ones(len(rays))
    for low, high, tag, actor in zip(scene.low, scene.high, scene.tags, scene.ids, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            a, b = (low - origin) / rays, (high - origin) / rays
        near, far = np.minimum(a, b), np.maximum(a, b)
        enter = near.max(axis=1)
        hit = (enter > 0) & (enter < far.min(axis=1)) & (enter < t_m)
        t_m[hit], tags[hit], ids[hit] = enter[hit], tag, actor
        shade[hit] = np.array([0.75, 0.55, 1.0])[near[hit].argmax(axis=1)]
    return t_m, tags, ids, shade


def camera_images(scene: Street, ego_x_m: float, yaw_deg: float, width_px: int) -> dict[str, AnyArray]:
    height_px = width_px * 9 // 16
    camera = PinholeCamera.from_field_of_view(width_px, height_px, np.radians(80))
    v, u = np.mgrid[:height_px, :width_px]
    optical = camera.rays(np.stack([u.ravel(), v.ravel()], axis=1))
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    map_from_optical = np.array([[sin, 0, cos], [-cos, 0, sin], [0, -1, 0]])
    rays = optical @ map_from_optical.T
    origin = np.array([ego_x_m, -1.9, 1.6])
    depth_m, tags, ids, shade = cast(scene, origin, rays)
    sky = ~np.isfinite(depth_m)
    table = np.zeros((256, 3))
    for tag, tint in _TINT.items():
        table[tag] = tint
    haze = np.where(sky, 1, 1 - np.exp(-np.where(sky, 0, depth_m) / 220))[:, None]
    blue = np.array([120, 165, 215]) + np.clip(1 - rays[:, 2:] * 3, 0, 1) * 70
    rgb = np.clip(table[tags] * shade[:, None] * (1 - haze) + blue * haze, 0, 255)
    points = origin + rays * np.where(sky, 1e5, depth_m)[:, None]
    before = (points - origin + [STEP_M, 0, 0]) @ map_from_optical
    with np.errstate(divide="ignore", invalid="ignore"):
        flow = np.stack([u.ravel(), v.ravel()], axis=1) - camera.project(before)
    flow[before[:, 2] <= 0] = np.nan
    shape = (height_px, width_px)
    return {
        "rgb": rgb.astype(np.uint8).reshape(*shape, 3),
        "semantic": tags.reshape(shape),
        "instance": ids.reshape(shape),
        "depth": depth_m.astype(np.float32).reshape(shape),
        "flow": flow.astype(np.float32).reshape(*shape, 2),
    }


def lidar_points(scene: Street, ego_x_m: float, columns: int = 512, channels: int = 48) -> Table:
    azimuth = np.arange(columns) / columns * 2 * np.pi
    elevation = np.radians(np.linspace(-30, 10, channels))
    a, e = (grid.ravel() for grid in np.meshgrid(azimuth, elevation))
    rays = np.stack([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)], axis=1)
    range_m, tags, ids, _ = cast(scene, np.array([ego_x_m, -1.9, 1.8]), rays)
    seen = range_m < 120
    points = np.zeros(
        int(seen.sum()),
        [("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("cos_angle", "<f4"), ("object_id", "<u4"), ("tag", "<u4")],
    )
    points["x"], points["y"], points["z"] = (rays[seen] * range_m[seen, None]).T
    points["object_id"], points["tag"] = ids[seen], tags[seen]
    return points


def radar_points(scene: Street, ego_x_m: float, yaw_deg: float) -> Table:
    rng = np.random.default_rng(0)
    azimuth, elevation = np.radians(rng.uniform([-50, -6], [50, 6], (2000, 2))).T
    rays = np.stack([np.cos(azimuth), np.sin(azimuth), np.tan(elevation)], axis=1)
    cos, sin = np.cos(np.radians(yaw_deg)), np.sin(np.radians(yaw_deg))
    turned = rays @ np.array([[cos, sin, 0], [-sin, cos, 0], [0, 0, 1]])
    range_m, _, _, _ = cast(scene, np.array([ego_x_m, -1.9, 0.6]), turned)
    seen = range_m < 120
    points = np.zeros(int(seen.sum()), [(name, "<f4") for name in ("x", "y", "z", "doppler_velocity")])
    points["x"], points["y"], points["z"] = (rays[seen] * range_m[seen, None]).T
    points["doppler_velocity"] = -STEP_M / TICK_NS * 1e9 * turned[seen, 0]
    return points


def bev_labels(scene: Street, ego_x_m: float, cells: int = 360, cell_m: float = 0.4) -> AnyArray:
    axis = ((cells - 1) / 2 - np.arange(cells)) * cell_m
    x, y = axis[:, None] + ego_x_m, axis[None, :] - 1.9
    bit = {name: 1 << k for k, name in enumerate(BEV_CLASSES)}
    labels = np.where(np.abs(y) < 3.8, bit["road"], 0) + np.where(
        (np.abs(y) >= 3.8) & (np.abs(y) < 6.2), bit["sidewalk"], 0
    )
    labels = labels + np.where((np.abs(y) < 0.2) & (x % 6 < 3), bit["road_line"], 0)
    names = {Tag.CAR: "car", Tag.TRUCK: "truck", Tag.PEDESTRIAN: "pedestrian"}
    for low, high, tag in zip(scene.low, scene.high, scene.tags, strict=True):
        if tag in names:
            labels[(x > low[0]) & (x < high[0]) & (y > low[1]) & (y < high[1])] |= bit[names[tag]]
    return labels.astype(np.uint16)


def box_table(scene: Street) -> Table:
    """Rows of /ego/boxes; columns that are not known here are blank."""
    classes = {Tag.CAR: "car", Tag.TRUCK: "truck", Tag.PEDESTRIAN: "pedestrian"}
    actors = np.isin(scene.tags, list(classes))
    low, high = scene.low[actors], scene.high[actors]
    rows = blank_boxes(len(low))
    rows["x"], rows["y"], rows["z"] = (low + high).T / 2
    rows["length"], rows["width"], rows["height"] = (high - low).T
    rows["class"] = [BOX_CLASSES.index(classes[Tag(tag)]) for tag in scene.tags[actors]]
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
    scene = street()
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
                images = camera_images(scene, ego_x_m, YAWS_DEG[camera], width_px)
                for modality in modalities if camera == "front" else ("rgb",):
                    form = ("/compressedDepth" if modality == "depth" else "/compressed") if compressed else ""
                    topic = f"/ego/cam_{camera}/{modality}/image_raw{form}"
                    data = make(stamp_ns, ENCODINGS[modality], images[modality])
                    write(topic, "CompressedImage" if compressed else "Image", stamp_ns, data)
            if from_above:
                cloud = point_cloud(stamp_ns, lidar_points(scene, ego_x_m))
                write("/ego/lidar/semantic_points", "PointCloud2", stamp_ns, cloud)
                write("/ego/bev/labels", "Image", stamp_ns, image(stamp_ns, "mono16", bev_labels(scene, ego_x_m)))
            for radar in radars:
                cloud = point_cloud(stamp_ns, radar_points(scene, ego_x_m, YAWS_DEG[radar]))
                write(f"/ego/radar_{radar}/points", "PointCloud2", stamp_ns, cloud)
            if boxes:
                write("/ego/boxes", "PointCloud2", stamp_ns, point_cloud(stamp_ns, box_table(scene)))
                pose = odometry(stamp_ns, np.array([ego_x_m, -1.9, 0.0]), np.zeros(3))
                write("/ego/odom", "Odometry", stamp_ns, pose)
        return writer.finish({"scene": path.name})
