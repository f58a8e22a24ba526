"""Input and output of the renderer: requested camera views, the world state to draw, and the resulting images."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

from simbev_ros.config.camera import Camera
from simbev_ros.config.modalities import IMAGE_KINDS, Modality
from simbev_ros.config.optics import IDEAL_OPTICS, Optics, Shutter
from simbev_ros.foundation.geometry.camera import PinholeCamera
from simbev_ros.foundation.random import stream
from simbev_ros.foundation.types import Float32Array, Float64Array, UInt8Array, UInt16Array
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.scene.interpolation import earlier_rows, interpolate_actors
from simbev_ros.schema.scene.state import WorldState

MOTION_S = 0.005
"""Time over which the motion during an exposure is measured: short, as wheels turn fast."""


@dataclass(frozen=True, slots=True)
class CameraView:
    """One camera of the ego and the images requested from it.

    Attributes:
        camera: Intrinsics.
        ego_from_sensor: (4, 4) pose of the camera's body frame (x forward, y left, z up).
        modalities: The requested modalities.
        optics: Exposure, vignetting and noise of the color image.
        noise_seed: Seed of the noise, below 2**64; different for every camera and tick.
        lens_seed: Seed of the drops on the lens, together with the camera's pose; differs between agents of a scene.
        outlines: Whether the semantic image has the outlines that people draw.
    """

    camera: PinholeCamera
    ego_from_sensor: Float64Array
    modalities: Sequence[Modality]
    optics: Optics = IDEAL_OPTICS
    noise_seed: int = 0
    lens_seed: int = 0
    outlines: bool = False

    @classmethod
    def from_config(
        cls,
        camera: Camera,
        seed: int,
        tick: int,
        modalities: Sequence[Modality] | None = None,
        *,
        lens_seed: int = 0,
    ) -> Self:
        """View of a configured camera at a tick of a scene with a seed, with all its modalities or a subset."""
        noise_seed = int(stream(seed, f"camera.{camera.name}", tick).integers(1 << 63))
        return cls(
            camera.model,
            camera.pose.ego_from_sensor,
            modalities or camera.modalities,
            camera,
            noise_seed,
            lens_seed,
            camera.labels == "drawn",
        )

    @property
    def shutter(self) -> Shutter | None:
        """Shutter of the camera; None: its images show one moment."""
        return None if self.optics.imager is None else self.optics.imager.shutter

    @property
    def rolls(self) -> bool:
        """Whether each row of its images is of another moment."""
        return self.shutter is not None and self.shutter.readout_s > 0.0

    @property
    def drawn(self) -> Self:
        """This view with the modalities that OpenGL draws, in place of those that are made from them."""
        modalities = dict.fromkeys("rgb" if IMAGE_KINDS[name].of_imager else name for name in self.modalities)
        if self.outlines and "semantic" in modalities:
            modalities["depth"] = None
        return replace(self, modalities=tuple(modalities))


@dataclass(frozen=True, slots=True)
class RenderFrame:
    """The world state to draw.

    Attributes:
        world: The current world state.
        previous: The world state one frame earlier, for the flow and the motion during an exposure; None: the first
            frame, in which nothing moves.
        show_ego: Draw the ego and its rider. By default they only cast shadows, because the cameras are inside.
    """

    world: WorldState
    previous: WorldState | None = None
    show_ego: bool = False

    @property
    def shortly_before(self) -> WorldState | None:
        """The world ``MOTION_S`` before this frame, between the previous frame and this one; None: nothing moves."""
        if self.previous is None or self.previous.stamp_ns >= self.world.stamp_ns:
            return None
        share = MOTION_S * NS_PER_S / (self.world.stamp_ns - self.previous.stamp_ns)
        earlier = earlier_rows(self.world.actors, self.previous.actors)
        return replace(self.world, actors=interpolate_actors(earlier, self.world.actors, 1.0 - share))


@dataclass(frozen=True, slots=True)
class CameraImages:
    """Images of one camera, row 0 on top, C-contiguous; None for modalities that were not requested.

    Attributes:
        rgb: (H, W, 3) uint8, sRGB.
        semantic: (H, W) uint8, a semantic ``Tag``, with outlines if the view has them.
        instance: (H, W) uint16, actor id, 0 = none.
        depth: (H, W) float32, meters along the optical axis, of a fisheye along the pixel's ray; +inf for the sky
            (REP-118). On a GPU and with lens distortion, it belongs to a point up to 1/256 pixel from the pixel center,
            because GPUs snap vertices to such a grid.
        flow: (H, W, 2) float32, pixels, x right and y down: current position minus position in the previous frame of
            the visible surface point. NaN where that point was not visible in the previous image: outside of it, or
            behind what it showed there. The sky is treated as infinitely far. An actor that did not exist before is
            treated as stationary.
        raw: (H, W) uint8, mosaic RGGB of light, from an imager.
    """

    rgb: UInt8Array | None = None
    semantic: UInt8Array | None = None
    instance: UInt16Array | None = None
    depth: Float32Array | None = None
    flow: Float32Array | None = None
    raw: UInt8Array | None = None
