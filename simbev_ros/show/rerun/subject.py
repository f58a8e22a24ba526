"""Subject of drawings: the scene, and its samples at one tick."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

from simbev_ros.config.rig import AnySensor
from simbev_ros.dataset.calibration import Calibration, calibrations
from simbev_ros.schema.scene.agents import AgentView
from simbev_ros.schema.trajectories import Tracks


class Samples(Protocol):
    """Samples of one tick by key; ``dataset.Frame`` is one."""

    @property
    def tick(self) -> int:
        """Number of the tick."""

    @property
    def stamp_ns(self) -> int:
        """Simulated time, ns."""

    def __contains__(self, key: object) -> bool: ...

    def __iter__(self) -> Iterator[str]: ...

    def __getitem__(self, key: str) -> Any:
        """The value, of the type that ``dataset.values`` documents."""

    def messages(self, key: str) -> list[Any]:
        """The messages, with JPEG and PNG as they are."""


@dataclass(frozen=True)
class Detail:
    """Limits on what is shown of a scene.

    Attributes:
        max_points: Maximum number of points of a cloud; half of it in its other colors.
        max_width_px: Maximum width of an image; None: as recorded.
        layers: Whether the cameras' other modalities and the other colors of lidar points are shown.
        limit_bytes: Approximate size of everything that is drawn. Large samples are thinned out for it.
    """

    max_points: int = 40_000
    max_width_px: int | None = None
    layers: bool = True
    limit_bytes: float = math.inf


@dataclass(frozen=True, eq=False)
class Subject:
    """The scene that is shown.

    Attributes:
        view: The scene as the agent that is shown sees it.
        tracks: Tracks of all actors; None if they are not known.
        detail: How much of it is shown.
    """

    view: AgentView
    tracks: Tracks | None = None
    detail: Detail = Detail()

    @cached_property
    def calibration(self) -> Mapping[str, Calibration]:
        """Calibrations by sensor name."""
        return calibrations(self.view.rig)

    def image_step(self, camera: str) -> int:
        """In each direction, every Nth pixel of a camera is shown."""
        width_px = self.calibration[camera].size_px[0]
        return 1 if self.detail.max_width_px is None else -(-width_px // self.detail.max_width_px)

    def sensors(self, kind: str) -> list[AnySensor]:
        """Sensors of a type, such as ``camera``, in the order of the rig."""
        return [sensor for sensor in self.view.rig.sensors if sensor.type == kind]


class Drawing(Protocol):
    """Draws one aspect of a scene."""

    def draw(self, samples: Samples) -> None:
        """Log what the samples of a tick contain of it.

        Raises:
            BagError: The samples cannot be read.
        """
