"""All drawings of a scene: those that are shown first, and those that can be switched on."""

from simbev_ros.show.rerun.boxes import BoxDrawing, PredictionDrawing
from simbev_ros.show.rerun.camera_layers import LAYERS, LayerDrawing
from simbev_ros.show.rerun.cameras import CameraDrawing
from simbev_ros.show.rerun.clouds import COLORINGS, FIRST_COLORING, LidarDrawing, OccupancyDrawing, RadarDrawing
from simbev_ros.show.rerun.ego import EgoDrawing
from simbev_ros.show.rerun.ground import GroundDrawing
from simbev_ros.show.rerun.plots import EventDrawing, FixDrawing, PlotDrawing
from simbev_ros.show.rerun.scene_log import SceneLog
from simbev_ros.show.rerun.scene_sheet import draw_sheet
from simbev_ros.show.rerun.subject import Drawing, Subject
from simbev_ros.show.rerun.vector_map import VectorMapDrawing


def main_drawings(log: SceneLog, subject: Subject) -> list[Drawing]:
    """Everything that is shown at first; what does not change in time is logged at once."""
    draw_sheet(log, subject.view)
    return [
        EgoDrawing(log, subject),
        PlotDrawing(log, subject),
        *(CameraDrawing(log, subject, sensor.name) for sensor in subject.sensors("camera")),
        *(LidarDrawing(log, subject, sensor.name, [FIRST_COLORING]) for sensor in subject.sensors("lidar")),
        *(RadarDrawing(log, subject, sensor.name) for sensor in subject.sensors("radar")),
        BoxDrawing(log, subject),
        PredictionDrawing(log, subject),
        GroundDrawing(log, subject.view),
        VectorMapDrawing(log),
        *(FixDrawing(log, sensor.name) for sensor in subject.sensors("gnss")),
        EventDrawing(log),
    ]


def layer_drawings(log: SceneLog, subject: Subject) -> list[Drawing]:
    """Occupied voxels, the other colors of lidar points, and the other modalities of the cameras."""
    colorings = [coloring for coloring in COLORINGS if coloring != FIRST_COLORING]
    return [
        OccupancyDrawing(log, subject),
        *(LidarDrawing(log, subject, sensor.name, colorings) for sensor in subject.sensors("lidar")),
        *(
            LayerDrawing(log, subject, sensor.name, modality)
            for modality in LAYERS
            for sensor in subject.sensors("camera")
        ),
    ]
