"""All drawings of a scene: those that are shown first, and the layers of cameras, which take longer."""

from simbev_ros.viewer.boxes import BoxDrawing, PredictionDrawing
from simbev_ros.viewer.camera_layers import LAYERS, LayerDrawing
from simbev_ros.viewer.cameras import CameraDrawing
from simbev_ros.viewer.clouds import LidarDrawing, OccupancyDrawing, RadarDrawing
from simbev_ros.viewer.ego import EgoDrawing
from simbev_ros.viewer.ground import GroundDrawing
from simbev_ros.viewer.plots import EventDrawing, FixDrawing, PlotDrawing
from simbev_ros.viewer.scene_log import SceneLog
from simbev_ros.viewer.scene_sheet import draw_sheet
from simbev_ros.viewer.subject import Drawing, Subject
from simbev_ros.viewer.vector_map import VectorMapDrawing


def main_drawings(log: SceneLog, subject: Subject) -> list[Drawing]:
    """Everything but the layers of cameras; what does not change in time is logged at once."""
    draw_sheet(log, subject.spec)
    return [
        EgoDrawing(log, subject),
        PlotDrawing(log, subject),
        *(CameraDrawing(log, subject, sensor.name) for sensor in subject.sensors("camera")),
        *(LidarDrawing(log, subject, sensor.name) for sensor in subject.sensors("lidar")),
        *(RadarDrawing(log, subject, sensor.name) for sensor in subject.sensors("radar")),
        BoxDrawing(log, subject),
        PredictionDrawing(log, subject),
        GroundDrawing(log),
        VectorMapDrawing(log),
        OccupancyDrawing(log, subject),
        *(FixDrawing(log, sensor.name) for sensor in subject.sensors("gnss")),
        EventDrawing(log),
    ]


def layer_drawings(log: SceneLog, subject: Subject) -> list[Drawing]:
    """The other modalities of the cameras."""
    return [LayerDrawing(log, sensor.name, modality) for modality in LAYERS for sensor in subject.sensors("camera")]
