"""Random changes of a sample: one affine map for points, boxes, cameras and the grid; and lidars that see less."""

from dataclasses import dataclass, field

import numpy as np

from simbev_ros.foundation.types import AnyArray, Float32Array, Float64Array, Table
from simbev_training.cache.layout import CM_PER_M
from simbev_training.cache.reader import Sample
from simbev_training.training.config import Augmentation


@dataclass(frozen=True, eq=False)
class Warp:
    """An affine map of the level frame.

    Attributes:
        matrix: (2, 2) map of x and y: a rotation with or without a flip, times the scale.
        scale: Factor of all lengths, also of heights.
        offset_m: (3,) translation, after the rest.
        slope: (2,) rise over x and y before the map: a small tilt of the ground, without effect on x and y.
    """

    matrix: Float64Array
    scale: float
    offset_m: Float64Array = field(default_factory=lambda: np.zeros(3))
    slope: Float64Array = field(default_factory=lambda: np.zeros(2))

    @classmethod
    def draw(cls, augmentation: Augmentation, rng: np.random.Generator) -> "Warp":
        """Draw a map."""
        angle_rad = np.radians(rng.uniform(-1.0, 1.0) * augmentation.rotation_deg)
        scale = float(rng.uniform(1.0 - augmentation.scale, 1.0 + augmentation.scale))
        flips = [-1.0 if augmentation.flip and rng.random() < 0.5 else 1.0 for _ in range(2)]
        cosine, sine = np.cos(angle_rad), np.sin(angle_rad)
        rotation = np.array([[cosine, -sine], [sine, cosine]])
        sigma_m = augmentation.translation_m
        offset_m = rng.normal(0.0, sigma_m, 3) if sigma_m else np.zeros(3)  # without it, other draws stay as they were
        slope = np.zeros(2)
        if augmentation.tilt_deg or augmentation.ground_m:
            slope = np.tan(np.radians(rng.normal(0.0, augmentation.tilt_deg, 2)))
            offset_m[2] += rng.normal(0.0, augmentation.ground_m)
        return cls(scale * rotation @ np.diag(flips), scale, offset_m, slope)

    @property
    def warped_from_level(self) -> Float64Array:
        """(4, 4) the map as a homogeneous transform."""
        result = np.eye(4)
        result[:2, :2] = self.matrix
        result[2, :3] = *self.slope, self.scale
        result[:3, 3] = self.offset_m
        return result

    @property
    def level_from_warped(self) -> Float32Array:
        """(2, 3) inverse of the map of x and y: the matrix, then the translation."""
        return np.linalg.inv(self.warped_from_level)[:2, [0, 1, 3]].astype(np.float32)

    def boxes(self, boxes: Table) -> Table:
        """(B,) boxes of a sample."""
        warped = boxes.copy()
        warped["x"], warped["y"] = self.matrix @ np.stack([boxes["x"], boxes["y"]]) + self.offset_m[:2, None]
        warped["vx"], warped["vy"] = self.matrix @ np.stack([boxes["vx"], boxes["vy"]])
        ahead = self.matrix @ np.stack([np.cos(boxes["yaw"]), np.sin(boxes["yaw"])])
        warped["yaw"] = np.arctan2(ahead[1], ahead[0])
        for name in ("z", "length", "width", "height"):
            warped[name] = boxes[name] * self.scale
        warped["z"] += self.slope @ np.stack([boxes["x"], boxes["y"]]) + self.offset_m[2]
        return warped

    def projections(self, pixel_from_level: Float32Array) -> Float32Array:
        """(K, 3, 4) projections of a sample."""
        return np.asarray(pixel_from_level @ np.linalg.inv(self.warped_from_level), np.float32)


@dataclass(frozen=True)
class Thinning:
    """Which points of a sample are left out.

    Attributes:
        share: Share of the points that are left out at random.
        coarse: Whether every second ring is left out: stripes of elevation.
        phase: Where the stripes begin, 0 … 2.
        near_m: Distance from the ego's origin within which points are left out.
        one_sweep: Whether all sweeps but the newest are left out.
    """

    share: float
    coarse: bool
    phase: float
    near_m: float = 0.0
    one_sweep: bool = False

    @classmethod
    def draw(cls, augmentation: Augmentation, rng: np.random.Generator) -> "Thinning":
        """Draw what is left out."""
        share, coarse = rng.uniform(0.0, augmentation.thinning), rng.random() < augmentation.every_second_ring
        phase = float(rng.uniform(0.0, 2.0))
        if not (augmentation.near_m or augmentation.one_sweep):  # other draws stay as they were
            return cls(float(share), bool(coarse), phase)
        near_m, one_sweep = rng.uniform(0.0, augmentation.near_m), rng.random() < augmentation.one_sweep
        return cls(float(share), bool(coarse), phase, float(near_m), bool(one_sweep))

    def sweeps(self, sample: Sample, rng: np.random.Generator) -> list[AnyArray]:
        """(N, 3) int16 points of each sweep of a sample, ego frame, cm, without those that are left out."""
        seen = sample.sweeps_cm[: 1 if self.one_sweep else None]
        none = np.zeros((0, 3), np.int16)
        kept = [none if each is None else self._kept(each, sample, rng) for each in seen]
        return kept + [none] * (len(sample.sweeps_cm) - len(kept))

    def _kept(self, points_cm: AnyArray, sample: Sample, rng: np.random.Generator) -> AnyArray:
        kept = rng.random(len(points_cm), np.float32) >= self.share
        if (self.coarse and sample.ring_deg > 0) or self.near_m:
            x, y, z = points_cm.astype(np.float32).T
        if self.coarse and sample.ring_deg > 0:
            lidar_cm = (sample.lidar_m * CM_PER_M).astype(np.float32)
            elevation_deg = np.degrees(np.arctan2(z - lidar_cm[2], np.hypot(x - lidar_cm[0], y - lidar_cm[1])))
            kept &= (elevation_deg / sample.ring_deg + self.phase) % 2.0 < 1.0
        if self.near_m:
            kept &= x * x + y * y >= (self.near_m * CM_PER_M) ** 2
        return points_cm.compress(kept, 0)
