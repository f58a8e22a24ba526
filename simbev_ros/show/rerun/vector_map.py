"""Draws the vector map: lanes, painted lines, edges of paved ground, crosswalks and stop lines around the ego."""

import rerun as rr

from simbev_ros.drawing.drawn_lines import drawn_lines
from simbev_ros.show.rerun.scene_log import WORLD, SceneLog
from simbev_ros.show.rerun.strokes import THIN_LINE
from simbev_ros.show.rerun.subject import Samples

VECTOR_MAP = f"{WORLD}/vector_map"


class VectorMapDrawing:
    """Draws the vector map, one entity for each kind of line."""

    def __init__(self, log: SceneLog) -> None:
        self._log = log

    def draw(self, samples: Samples) -> None:
        """Log the lines."""
        if "vector_map" in samples:
            for lines in drawn_lines(samples["vector_map"]):
                strips = rr.LineStrips3D(lines.polylines_m, colors=lines.color, radii=THIN_LINE)
                self._log.add(f"{VECTOR_MAP}/{lines.kind}", strips)
