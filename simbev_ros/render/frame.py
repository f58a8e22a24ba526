"""What the renderer is asked for and what it returns."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

from simbev_ros.config.camera import Camera, Modality
from simbev_ros.config.optics import IDEAL_OPTICS, Optics
from simbev_ros.geometry.camera import PinholeCamera
from simbev_ros.random import stream
from simbev_ros.scene.state import WorldState
from simbev_ros.types import Float32Array, Float64Array, UInt8Array, UInt16Array


@dataclass(frozen=True, slots=True)
class CameraView:
    """One camera of the ego.

    Attributes:
        camera: Its intrinsics.
        ego_from_sensor: (4, 4) pose of the camera's body frame (x forward, y left, z up).
        modalities: The wanted images.
        optics: Exposure, vignetting and noise of the colour image.
        noise_seed: Of the noise, below 2**64; another one for every camera and moment.
    """

    camera: PinholeCamera
    ego_from_sensor: Float64Array
    modalities: Sequence[Modality]
    optics: Optics = IDEAL_OPTICS
    noise_seed: int = 0

    @classmethod
    def of(cls, camera: Camera, seed: int, tick: int, modalities: Sequence[Modality] | None = None) -> Self:
        """A camera of the rig at a tick of a scene with a seed, with all its modalities or some of them."""
        noise_seed = int(stream(seed, f"camera.{camera.name}", tick).integers(1 << 63))
        return cls(camera.model, camera.pose.ego_from_sensor, modalities or camera.modalities, camera, noise_seed)


@dataclass(frozen=True, slots=True)
class RenderFrame:
    """The moment to draw.

    Attributes:
        world: The world now.
        previous: The world one frame before, for the flow; None: there is none, and the flow is zero.
        show_ego: Draw the ego and its rider. By default they only cast their shadow, because the cameras sit inside.
    """

    world: WorldState
    previous: WorldState | None = None
    show_ego: bool = False


@dataclass(frozen=True, slots=True)
class CameraImages:
    """Images of one camera, row 0 on top, C-contiguous; None where the modality was not asked for.

    Attributes:
        rgb: (H, W, 3) uint8, sRGB.
        semantic: (H, W) uint8, a semantic ``Tag``.
        instance: (H, W) uint16, actor id, 0 = none.
        depth: (H, W) float32, metres along the optical axis, +inf for the sky (REP-118). On a GPU
            and with a lens that distorts, it is that of a point up to 1/256 pixel beside the pixel's centre, because
            GPUs snap vertices to such a grid.
        flow: (H, W, 2) float32, pixels, x right and y down: position now minus position in the previous frame of the
            surface point seen now. NaN where that point was behind the previous camera, or so far beside the view that
            the model of the lens does not hold there. The sky counts as infinitely far. An actor that was not there
            before counts as at rest.
    """

    rgb: UInt8Array | None = None
    semantic: UInt8Array | None = None
    instance: UInt16Array | None = None
    depth: Float32Array | None = None
    flow: Float32Array | None = None
