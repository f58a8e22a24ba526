"""Configuration of a training run."""

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, ValidationError, field_validator

from simbev_ros.baselines.modality import Modality
from simbev_ros.config.base import Model, first_problem
from simbev_ros.config.map_files import expand_home
from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError
from simbev_ros.foundation.files.input_file import is_file

_SHIPPED = Path(__file__).parents[1] / "config"
_OF_EXPORT = ("average_with", "export_weights")
"""Fields that change the exported file alone."""


class Augmentation(Model):
    """Random changes of each sample, different in each epoch."""

    flip: bool = Field(True, description="mirror x, y and each image, all with a probability of one half")
    rotation_deg: float = Field(45.0, ge=0, le=180, description="maximum rotation about z, in both directions")
    scale: float = Field(0.1, ge=0, lt=0.5, description="maximum change of scale: 0.1 is a factor of 0.9 to 1.1")
    translation_m: float = Field(
        0.0,
        ge=0,
        le=20,
        description="standard deviation of a shift in x, y and z; the paper's models (BEVFusion): 0.5",
    )
    tilt_deg: float = Field(
        0.0, ge=0, le=10, description="standard deviation of a tilt of the ground, ahead and to the left"
    )
    ground_m: float = Field(0.0, ge=0, le=2, description="standard deviation of a shift in z alone")
    one_sweep: float = Field(0.0, ge=0, le=1, description="share of samples that see the newest sweep alone")
    near_m: float = Field(
        0.0,
        ge=0,
        le=10,
        description="maximum distance within which points are left out, as those on the vehicle's own body often are",
    )
    thinning: float = Field(0.5, ge=0, lt=1, description="maximum share of the lidar's points that is left out")
    every_second_ring: float = Field(
        0.25,
        ge=0,
        le=1,
        description="share of samples that see every second ring of the lidar, like a coarser one, if it has evenly "
        "spaced ones",
    )
    pasting: float = Field(
        0.5, ge=0, le=1, description="share of samples that get trucks, buses and two-wheelers of others"
    )
    missing_cameras: float = Field(
        0.0,
        ge=0,
        le=1,
        description="share of samples that lack cameras, half of them on average, as rigs with fewer do",
    )
    zoom: float = Field(0.08, ge=0, lt=0.5, description="maximum zoom of an image: 0.08 is a factor of 0.92 to 1.08")
    image_rotation_deg: float = Field(3.0, ge=0, le=45, description="maximum rotation of an image, in both directions")
    brightness: float = Field(0.3, ge=0, lt=1, description="maximum change of an image's brightness and contrast")


class Training(Model):
    """Configuration of a baseline's training."""

    modality: Modality = Field(description="what the model sees: camera, lidar or fused")
    seed: int = Field(0, ge=0, description="seed of weights, order and augmentation")
    scenes: int | None = Field(
        None, ge=1, description="number of scenes of each dataset to train on, the first by number"
    )
    sweep_ages_s: tuple[Annotated[float, Field(ge=0, le=10)], ...] = Field(
        (0.0, 0.25, 0.5, 1.0, 2.0),
        min_length=1,
        description="ages of the lidar's sweeps that a frame has, ascending from 0: recent ones show motion, old ones "
        "what is hidden by now",
    )
    min_points: int = Field(
        1,
        ge=1,
        le=100,
        description="boxes with fewer points are not learned, nor is it wrong to find them: what one or two points are "
        "cannot be seen, and to guess is what makes a model find people everywhere",
    )
    epochs: int = Field(20, ge=1, le=10_000, description="passes over the data")
    batch_size: int = Field(16, ge=1, le=1024, description="samples in a step")
    learning_rate: float = Field(
        2e-3, gt=0, le=1, description="maximum learning rate; it rises for 5 % of the steps and falls to 0 as a cosine"
    )
    weight_decay: float = Field(0.01, ge=0, le=1, description="decay of weights of AdamW")
    average_decay: float = Field(
        0.998, ge=0, lt=1, description="decay of the moving average of weights, which is what is exported"
    )
    compile: bool = Field(
        True,
        description="on a GPU: compile parts of the network, which takes 20 s and a C compiler; a step is 15 % faster",
    )
    start_from: tuple[str, ...] = Field(
        (),
        description="trained models that a new run takes weights from, where they fit: ONNX files, relative to this "
        "file, or camera, lidar, fused: those of the package",
    )
    augmentation: Augmentation = Field(Augmentation(), description="random changes of samples")
    average_with: tuple[str, ...] = Field(
        (),
        description="trained models that the exported one averages its own answers with, as an ensemble: named as in "
        "start_from; they see nothing that this one does not",
    )
    export_weights: Literal["half", "int8"] = Field(
        "half", description="weights in the exported file: 16 bits, or 8 bits with a scale for each output channel"
    )

    def differing(self, other: "Training") -> list[str]:
        """Names of the fields in which another configuration would train another model."""
        fields = [name for name in type(self).model_fields if name not in _OF_EXPORT]
        return [name for name in fields if getattr(self, name) != getattr(other, name)]

    @field_validator("sweep_ages_s")
    @classmethod
    def _ascend(cls, ages_s: tuple[float, ...]) -> tuple[float, ...]:
        if ages_s[0] != 0 or sorted(set(ages_s)) != list(ages_s):
            raise ValueError("must begin with 0 and ascend")
        return ages_s


def load_training(path_or_name: str | Path) -> Training:
    """Load a configuration of training: a file, or the shipped one of that name (``camera``, ``lidar``, ``fused``).

    Raises:
        InputError: There is no such file, or it is invalid; the message names file, line, field and what is allowed.
    """
    path = Path(path_or_name)
    if not is_file(path):
        shipped = {each.stem: each for each in sorted(_SHIPPED.glob("*.yaml"))}
        if str(path_or_name) not in shipped:
            raise InputError(f"{path}: no such file; shipped configurations are {', '.join(shipped)}")
        path = shipped[str(path_or_name)]
    file = YamlFile(path)
    try:
        training = Training.model_validate(file.data)
    except ValidationError as error:
        raise InputError(f"{path}:{file.line_of(error.errors()[0]['loc']) or 1}: {first_problem(error)}") from None
    except FOREIGN_ERRORS as error:
        raise InputError(f"{path}: {first_problem(error)}") from None
    return training.model_copy(
        update={
            name: tuple(_model_file(each, path.parent) for each in getattr(training, name))
            for name in ("start_from", "average_with")
        }
    )


def _model_file(name: str, folder: Path) -> str:
    """A model of the package by its name; any other by its absolute path, so that a run can resume in any folder."""
    return name if name in list(Modality) else str((folder / expand_home(name)).absolute())
