"""Configuration of a training run."""

from pydantic import Field

from simbev_ros.baselines.modality import Modality
from simbev_ros.config.base import Model


class Augmentation(Model):
    """Random changes of each sample, drawn anew in each epoch."""

    flip: bool = Field(True, description="mirror x and y, each with a probability of one half")
    rotation_deg: float = Field(22.5, ge=0, le=180, description="maximum rotation about z, in both directions")
    scale: float = Field(0.1, ge=0, lt=0.5, description="maximum change of scale: 0.1 is a factor of 0.9 to 1.1")
    brightness: float = Field(0.3, ge=0, lt=1, description="maximum change of an image's brightness and contrast")


class Training(Model):
    """How a baseline is trained."""

    modality: Modality = Field(description="what the model sees: camera, lidar or fused")
    seed: int = Field(0, ge=0, description="seed of weights, order and augmentation")
    scenes: int | None = Field(None, ge=1, description="number of scenes to train on, the first by number; none: all")
    epochs: int = Field(20, ge=1, le=10_000, description="passes over the data")
    batch_size: int = Field(16, ge=1, le=1024, description="samples in a step")
    learning_rate: float = Field(
        2e-3, gt=0, le=1, description="maximum learning rate; it rises for 5 % of the steps and falls to 0 as a cosine"
    )
    weight_decay: float = Field(0.01, ge=0, le=1, description="decay of weights of AdamW")
    average_decay: float = Field(
        0.998, ge=0, lt=1, description="decay of the moving average of weights, which is what is exported"
    )
    augmentation: Augmentation = Field(Augmentation(), description="random changes of samples")
