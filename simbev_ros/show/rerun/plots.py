"""Draws what can be plotted over time, the ego's position on the earth, and the collisions of the scene."""

import json
from collections.abc import Mapping, Sequence

import numpy as np
import rerun as rr

from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.schema.palette import class_color
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.strokes import FIX, TRACK
from simbev_ros.show.rerun.subject import Samples, Subject

SPEED, ACCELERATION, TURN_RATE, BOX_COUNTS, TICK_RATE = (
    "plots/speed",
    "plots/acceleration",
    "plots/turn_rate",
    "plots/boxes",
    "plots/ticks_per_second",
)
GNSS, EVENTS = "gnss", "events"
_AXES = {"x": (235, 95, 85), "y": (95, 200, 110), "z": (95, 145, 250)}
_TRACK_COLOR = (230, 70, 60)
_MAX_TRACK_POINTS = 4000


class PlotDrawing:
    """Draws speed, IMU, counts of boxes and ticks per second."""

    def __init__(self, log: SceneLog, subject: Subject) -> None:
        self._log, self._imus = log, [sensor.name for sensor in subject.sensors("imu")]
        _name_series(log, SPEED, {"speed": (255, 196, 60)})
        for entity in (ACCELERATION, TURN_RATE):
            for imu in self._imus:
                _name_series(log, f"{entity}/{imu}", {f"{imu} {axis}": color for axis, color in _AXES.items()})
        for name in BOX_CLASSES:
            _name_series(log, f"{BOX_COUNTS}/{name}", {name: class_color(name)})

    def draw(self, samples: Samples) -> None:
        """Log the numbers."""
        if "odom" in samples:
            speed_mps = float(np.linalg.norm(samples["odom"][-1]["velocity_mps"]))
            self._log.add(SPEED, rr.Scalars(speed_mps))
        for imu in self._imus:
            key = next((key for key in (f"{imu}/data", f"{imu}/data_raw") if key in samples), None)
            if key is not None:
                row = samples[key][-1]
                self._log.add(f"{ACCELERATION}/{imu}", rr.Scalars(row["acceleration_mps2"]))
                self._log.add(f"{TURN_RATE}/{imu}", rr.Scalars(row["angular_velocity_radps"]))
        if "boxes" in samples:
            counts = np.bincount(samples["boxes"]["class"], minlength=len(BOX_CLASSES)).tolist()
            for name, count in zip(BOX_CLASSES, counts, strict=False):
                self._log.add(f"{BOX_COUNTS}/{name}", rr.Scalars(count))


class FixDrawing:
    """Draws the fixes of a GNSS receiver on a map."""

    def __init__(self, log: SceneLog, name: str) -> None:
        self._log, self._name, self._track_deg = log, name, list[list[float]]()

    def draw(self, samples: Samples) -> None:
        """Log the fix and the track; there is none during drop-outs."""
        if (key := f"{self._name}/fix") not in samples:
            return
        row = samples[key][-1]
        position_deg = [float(row["latitude_deg"]), float(row["longitude_deg"])]
        if not np.isfinite(position_deg).all():
            return
        self._track_deg = [*self._track_deg, position_deg][-_MAX_TRACK_POINTS:]
        self._log.add(
            f"{GNSS}/{self._name}/fix",
            rr.GeoPoints(lat_lon=[position_deg], radii=FIX, colors=_TRACK_COLOR),
        )
        if len(self._track_deg) > 1:
            track = rr.GeoLineStrings(lat_lon=[self._track_deg], radii=TRACK, colors=_TRACK_COLOR)
            self._log.add(f"{GNSS}/{self._name}/track", track)


class EventDrawing:
    """Lists collisions."""

    def __init__(self, log: SceneLog) -> None:
        self._log = log

    def draw(self, samples: Samples) -> None:
        """Log the events of a tick."""
        if "world/events" in samples:
            for event in samples["world/events"]:
                self._log.add(EVENTS, rr.TextLog(json.dumps(event), level=rr.TextLogLevel.WARN))


def _name_series(log: SceneLog, entity: str, colors: Mapping[str, Sequence[int]]) -> None:
    log.add_static(entity, rr.SeriesLines(names=[*colors], colors=[*colors.values()]))
