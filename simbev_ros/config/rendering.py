"""Section ``rendering``: image quality, and the devices and processes that render."""

from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from simbev_ros.config.base import Model

Quality = Literal["low", "medium", "high"]
QUALITIES: tuple[Quality, ...] = get_args(Quality)
"""Qualities of color images, from fastest to best. Labels, depth and flow are the same in all."""

Device = Literal["auto", "cpu"] | Annotated[int, Field(ge=0)]
"""Device on which a process renders: a GPU if EGL has one, else the CPU; always the CPU; or an EGL device by number."""


class Rendering(Model):
    """Rendering of camera images."""

    quality: Quality = Field("medium", description="quality of color images: low is fastest, high is best")
    gpus: Literal["auto"] | tuple[Annotated[int, Field(ge=0, le=255)], ...] = Field(
        "auto",
        description="GPUs that render; auto: all that EGL has, else the CPU; []: the CPU; "
        "or EGL device numbers from `simbev doctor`",
    )
    processes: Literal["auto"] | Annotated[int, Field(ge=1, le=16)] = Field(
        "auto",
        description="number of processes that share the rig's cameras; auto: one per GPU, two with 8 or more CPU cores "
        "per GPU; without a GPU one per CPU core",
    )

    @model_validator(mode="after")
    def _gpus_once(self) -> Self:
        if self.gpus != "auto" and len(set(self.gpus)) != len(self.gpus):
            raise ValueError(f"gpus: each at most once, not {list(self.gpus)}")
        return self

    def device_of(self, process: int) -> Device:
        """Device on which a camera process, numbered from 0, renders."""
        if self.gpus == "auto":
            return "auto"
        return self.gpus[process % len(self.gpus)] if self.gpus else "cpu"
