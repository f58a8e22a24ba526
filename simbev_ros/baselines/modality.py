"""Modalities of baselines."""

from enum import StrEnum


class Modality(StrEnum):
    """Sensors of a baseline: cameras, lidar, or both."""

    CAMERA = "camera"
    LIDAR = "lidar"
    FUSED = "fused"

    @property
    def has_cameras(self) -> bool:
        """Whether it sees images."""
        return self is not Modality.LIDAR

    @property
    def has_lidar(self) -> bool:
        """Whether it sees clouds."""
        return self is not Modality.CAMERA
