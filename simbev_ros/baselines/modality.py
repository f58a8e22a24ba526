"""What a baseline sees."""

from enum import StrEnum


class Modality(StrEnum):
    """What a baseline sees: images, clouds, or both."""

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
