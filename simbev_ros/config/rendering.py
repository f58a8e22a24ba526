"""How pictures are drawn, and on what."""

from typing import Annotated, Literal, Self, get_args

from pydantic import Field, model_validator

from simbev_ros.config.base import Model

Quality = Literal["low", "medium", "high"]
QUALITIES: tuple[Quality, ...] = get_args(Quality)
"""From fast to beautiful. Labels, depth and flow are the same in all."""

Device = Literal["auto", "cpu"] | Annotated[int, Field(ge=0)]
"""What one process draws on: a GPU if EGL has one, else the CPU; the CPU; or the EGL device of a number."""


class Rendering(Model):
    """How cameras are drawn."""

    quality: Quality = Field("medium", description="of colour images: low is fast, high is beautiful")
    gpus: Literal["auto"] | tuple[Annotated[int, Field(ge=0, le=255)], ...] = Field(
        "auto",
        description="auto: all that EGL has, else the CPU; []: the CPU; or EGL devices as `simbev doctor` counts them",
    )
    processes: Literal["auto"] | Annotated[int, Field(ge=1, le=16)] = Field(
        "auto", description="that share the rig's cameras; auto: one for each GPU, or on the CPU one for each core"
    )

    @model_validator(mode="after")
    def _gpus_once(self) -> Self:
        if self.gpus != "auto" and len(set(self.gpus)) != len(self.gpus):
            raise ValueError(f"gpus: each at most once, not {list(self.gpus)}")
        return self

    def device_of(self, process: int) -> Device:
        """What the camera process of a number, from 0, draws on."""
        if self.gpus == "auto":
            return "auto"
        return self.gpus[process % len(self.gpus)] if self.gpus else "cpu"
