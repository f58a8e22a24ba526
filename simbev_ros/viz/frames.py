"""A bag as a series of frames: at each tick, what every sensor that is worth a look has seen last."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from simbev_ros.config.radar import Radar
from simbev_ros.errors import BagError
from simbev_ros.recording.arrays import image_array, point_array
from simbev_ros.recording.reader import RawMessage, SceneBag
from simbev_ros.types import AnyArray, Float64Array

CAMERA_ORDER = ("front_left", "front", "front_right", "back_left", "back", "back_right")
MODALITIES = ("semantic", "instance", "depth", "flow")

_IMAGE = re.compile(r"/[^/]+/(?P<camera>[^/]+)/(?P<modality>[^/]+)/image_raw(/compressed(Depth)?)?")
_POINTS = re.compile(r"/[^/]+/[^/]+/semantic_points")
_BEV = re.compile(r"/[^/]+/bev/labels")
_HOLD_NS = 1_000_000_000
"""A sensor slower than the others is shown with its last sample, but not with one that is older than this."""


@dataclass(frozen=True, slots=True)
class Views:
    """The topics that are looked at.

    Attributes:
        cameras: RGB topic by camera, in panorama order.
        main_camera: The camera whose other modalities are shown.
        modalities: Topic by modality, of the main camera.
        points: Topic of the semantic lidar.
        radars: (4, 4) ego_from_radar by the radar's topic.
        bev: Topic of the bird's-eye-view labels.
    """

    cameras: Mapping[str, str]
    main_camera: str
    modalities: Mapping[str, str]
    points: str | None
    radars: Mapping[str, Float64Array]
    bev: str | None

    @property
    def topics(self) -> list[str]:
        """All of them."""
        single = [topic for topic in (self.points, self.bev) if topic is not None]
        return [*self.cameras.values(), *self.modalities.values(), *self.radars, *single]


@dataclass(frozen=True, slots=True)
class Frame:
    """What was seen at one tick.

    Attributes:
        index: Its place among the bag's frames.
        arrays: By topic; only topics that have something recent.
    """

    index: int
    stamp_ns: int
    arrays: Mapping[str, AnyArray]


def find_views(bag: SceneBag) -> Views:
    """Choose topics by the patterns of their names; raw images before compressed ones.

    Raises:
        BagError: There is nothing to look at.
    """
    names = [topic.name for topic in bag.topics.values() if len(topic.stamps_ns)]
    images: dict[tuple[str, str], str] = {}
    for name in sorted(names, key=len):
        if match := _IMAGE.fullmatch(name):
            images.setdefault((match["camera"], match["modality"]), name)
    cameras = sorted({camera for camera, modality in images if modality == "rgb"}, key=_panorama_place)
    others = sorted({camera for camera, modality in images if modality in MODALITIES}, key=_main_place)
    main = others[0] if others else ""
    views = Views(
        {camera: images[camera, "rgb"] for camera in cameras},
        main,
        {modality: images[main, modality] for modality in MODALITIES if (main, modality) in images},
        next((name for name in names if _POINTS.fullmatch(name)), None),
        {topic: pose for topic, pose in _radar_poses(bag).items() if topic in names},
        next((name for name in names if _BEV.fullmatch(name)), None),
    )
    if not views.topics:
        raise BagError(f"{bag.path}: no images, semantic points or bird's-eye-view labels to show")
    return views


@dataclass(slots=True)
class FrameReader:
    """The frames of a bag.

    Attributes:
        stamps_ns: Stamp of each frame: every stamp that any of the topics has.
    """

    bag: SceneBag
    views: Views
    stamps_ns: list[int] = field(init=False)

    def __post_init__(self) -> None:
        stamps = [self.bag.topics[topic].stamps_ns for topic in self.views.topics]
        self.stamps_ns = np.unique(np.concatenate(stamps)).tolist()

    @property
    def rate_hz(self) -> float:
        """Frames per second of simulated time; 1 if there is one frame only."""
        return 1e9 / float(np.median(np.diff(self.stamps_ns))) if len(self.stamps_ns) > 1 else 1.0

    def aspects(self) -> dict[str, float]:
        """Width over height of each topic's picture; a point cloud's is square."""
        firsts = {topic: next(self.bag.messages([topic])) for topic in self.views.topics}
        arrays = {topic: self._array(message) for topic, message in firsts.items()}
        return {topic: a.shape[1] / a.shape[0] if a.ndim > 1 else 1.0 for topic, a in arrays.items()}

    def frames(self, first: int, count: int) -> Iterator[Frame]:
        """``count`` frames from the one at index ``first`` on."""
        places = {stamp_ns: i for i, stamp_ns in enumerate(self.stamps_ns)}
        latest: dict[str, RawMessage] = {}
        decoded: dict[str, tuple[int, AnyArray]] = {}

        def frame(stamp_ns: int) -> Frame:
            for topic, message in list(latest.items()):
                if message.stamp_ns < stamp_ns - _HOLD_NS:
                    del latest[topic]
                elif decoded.get(topic, (None,))[0] != message.stamp_ns:
                    decoded[topic] = message.stamp_ns, self._array(message)
            return Frame(places[stamp_ns], stamp_ns, {topic: decoded[topic][1] for topic in latest})

        start_ns, end_ns = self.stamps_ns[first], self.stamps_ns[first + count - 1]
        now_ns = start_ns
        for message in self.bag.messages(self.views.topics, from_ns=start_ns - _HOLD_NS, to_ns=end_ns):
            if message.stamp_ns > now_ns:
                yield frame(now_ns)
                now_ns = message.stamp_ns
            latest[message.topic] = message
        yield frame(now_ns)

    def _array(self, message: RawMessage) -> AnyArray:
        array = point_array if message.type_name == "sensor_msgs/msg/PointCloud2" else image_array
        return array(self.bag.decode(message))


def _radar_poses(bag: SceneBag) -> dict[str, Float64Array]:
    """Topic of each radar of the scene's rig → where it is."""
    rig = bag.spec.rig if bag.spec else None
    radars = rig.of_type(Radar) if rig else ()
    return {f"/{rig.agent}/{radar.name}/points": radar.pose.ego_from_sensor for radar in radars} if rig else {}


def _panorama_place(camera: str) -> tuple[int, str]:
    name = camera.removeprefix("cam_")
    return (CAMERA_ORDER.index(name) if name in CAMERA_ORDER else len(CAMERA_ORDER), name)


def _main_place(camera: str) -> tuple[bool, int, str]:
    """The front camera first, then in panorama order."""
    return (camera.removeprefix("cam_") != "front", *_panorama_place(camera))
