"""Random flips, rotation and scale of the bird's-eye view, one linear map for points, boxes, cameras and the grid."""

from dataclasses import dataclass

import numpy as np

from simbev_ros.baselines.training.config import Augmentation
from simbev_ros.types import Float32Array, Float64Array, Table


@dataclass(frozen=True, eq=False)
class Warp:
    """A linear map of the level frame.

    Attributes:
        matrix: (2, 2) map of x and y: a rotation with or without a flip, times the scale.
        scale: Factor of all lengths, also of heights.
    """

    matrix: Float64Array
    scale: float

    @classmethod
    def draw(cls, augmentation: Augmentation, rng: np.random.Generator) -> "Warp":
        """Draw a map."""
        angle_rad = np.radians(rng.uniform(-1.0, 1.0) * augmentation.rotation_deg)
        scale = float(rng.uniform(1.0 - augmentation.scale, 1.0 + augmentation.scale))
        flips = [-1.0 if augmentation.flip and rng.random() < 0.5 else 1.0 for _ in range(2)]
        cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
        rotation = np.array([[cosine, -sine], [sine, cosine]])
        return cls(scale * rotation @ np.diag(flips), scale)

    @property
    def warped_from_level(self) -> Float64Array:
        """(4, 4) the map as a homogeneous transform."""
        result = np.eye(4)
        result[:2, :2] = self.matrix
        result[2, 2] = self.scale
        return result

    def boxes(self, boxes: Table) -> Table:
        """(B,) boxes of a sample."""
        warped = boxes.copy()
        warped["x"], warped["y"] = self.matrix @ np.stack([boxes["x"], boxes["y"]])
        warped["vx"], warped["vy"] = self.matrix @ np.stack([boxes["vx"], boxes["vy"]])
        ahead = self.matrix @ np.stack([np.cos(boxes["yaw"]), np.sin(boxes["yaw"])])
        warped["yaw"] = np.arctan2(ahead[1], ahead[0])
        for name in ("z", "length", "width", "height"):
            warped[name] = boxes[name] * self.scale
        return warped

    def projections(self, pixel_from_level: Float32Array) -> Float32Array:
        """(K, 3, 4) projections of a sample."""
        return np.asarray(pixel_from_level @ np.linalg.inv(self.warped_from_level), np.float32)
