"""Answers frames with a trained baseline on ONNX Runtime, on the CPU or a GPU."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from simbev_ros.baselines.boxes import decode_boxes
from simbev_ros.baselines.frames import sweep_ages_ns
from simbev_ros.baselines.modality import Modality
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.foundation.installation.extras import load_extras
from simbev_ros.foundation.semantics import BEV_CLASSES
from simbev_ros.foundation.types import Float32Array, Table, UInt8Array

if TYPE_CHECKING:
    from onnxruntime import InferenceSession

WEIGHTS_FOLDER = Path(__file__).parent / "weights"
"""Weights that come with the package: ``lidar.onnx`` and so on."""
ABOUT_KEY = "simbev_ros"
"""Metadata of an ONNX file: what it is, as JSON."""
_SMALL = ("small_heat", "small_boxes")
_HEADS = ("heat", "boxes", *_SMALL)
"""Outputs with peaks and values of boxes; models of earlier versions have all classes in the first two."""
_MAX_SWEEPS, _MAX_AGE_S = 64, 60.0
_MAX_IMAGE_VALUES = 1 << 28


@dataclass(frozen=True, eq=False)
class Answer:
    """A baseline's answer to a frame.

    Attributes:
        cells: (CELLS, CELLS, len(BEV_CLASSES)) uint8 scores, 255 is 1; row 0 ahead, column 0 left.
        boxes: (N,) ``boxes.BOX_DTYPE``, level frame, by descending score.
    """

    cells: UInt8Array
    boxes: Table


class Baseline:
    """A trained baseline.

    Args:
        path: ONNX file that ``simbev train`` wrote.
        threads: Threads on the CPU; None: one for each core.
        gpu: Whether to use the GPU if ONNX Runtime has been installed for it.

    Attributes:
        modality: What it sees.
        camera_size_px: Width and height of the images it takes; None without cameras.
        cameras: Number of its images.
        sweep_ages_ns: Ages of the sweeps it takes, ascending.

    Raises:
        InputError: ONNX Runtime is not installed, or the file is not such a model.
    """

    def __init__(self, path: Path, threads: int | None = None, *, gpu: bool = True) -> None:
        self._path, self._session = path, open_session(path, threads, gpu=gpu)
        with foreign_content(f"{path}: {ABOUT_KEY}"):
            text = self._session.get_modelmeta().custom_metadata_map.get(ABOUT_KEY)
            if text is None:
                raise InputError(f"{path}: is not a baseline of simbev_ros; `simbev train` writes such files")
            about: dict[str, Any] = parse_json(text)
            missing = {"modality", "sweep_ages_s"} - about.keys()
            if missing:
                raise InputError(f"{path}: says no {', '.join(sorted(missing))}; export it with this version")
            self.about = about
            self.modality = Modality(about["modality"])
            self.sweep_ages_ns = _sweep_ages_ns(about["sweep_ages_s"])
        outputs = {each.name for each in self._session.get_outputs()}
        self._heads = [name for name in _HEADS if name in outputs or name not in _SMALL]
        with foreign_content(f"{path}: inputs"):
            shapes = {each.name: each.shape for each in self._session.get_inputs()}
            images = [int(each) for each in shapes.get("images") or ()]
            self.cameras = images[0] if images else 0
            self.camera_size_px = (images[2], images[1]) if images else None
            if images and not (min(images) > 0 and math.prod(images) <= _MAX_IMAGE_VALUES):
                raise ValueError(f"images: have the shape {images!s:.80}; at most {_MAX_IMAGE_VALUES:,} are read")

    def answer(
        self,
        points: Float32Array | None = None,
        images: Sequence[UInt8Array] | UInt8Array | None = None,
        pixel_from_level: Float32Array | None = None,
    ) -> Answer:
        """Answer one frame; what the model does not see may be left out.

        Args:
            points: (N, 4) x, y, z (m, level frame) and index of the sweep, 0 the newest; see ``frames``.
            images: K images (H, W, 3), RGB.
            pixel_from_level: (K, 3, 4) projections to u * depth, v * depth, depth; pixel centers at integers.

        Raises:
            InputError: The model does not compute what a baseline does.
        """
        given = {
            "points": None if points is None else np.ascontiguousarray(points, np.float32),
            "images": None if images is None else np.ascontiguousarray(np.stack(list(images))),
            "pixel_from_level": None if pixel_from_level is None else np.asarray(pixel_from_level, np.float32),
        }
        try:
            feed = {each.name: given[each.name] for each in self._session.get_inputs()}
            return decode_answer(*self._session.run(["cells", *self._heads], feed))
        except Exception as error:  # ONNX Runtime's errors have no common base
            raise InputError(f"{self._path}: cannot answer: {' '.join(str(error).split())[:200]}") from error


def decode_answer(cells: UInt8Array, *heads: Float32Array) -> Answer:
    """The answer that a model's outputs are: cells, then peaks and values of boxes of each head in turn."""
    boxes = decode_boxes(list(zip(heads[::2], heads[1::2], strict=True)))
    later = len(BEV_CLASSES) - cells.shape[2]  # classes that came after the model was trained
    return Answer(np.pad(cells, ((0, 0), (0, 0), (0, later))) if later else cells, boxes)


def _sweep_ages_ns(ages_s: Any) -> tuple[int, ...]:
    """Ages of sweeps in ns; raises ValueError if a model cannot have them."""
    is_list = isinstance(ages_s, list) and 1 <= len(ages_s) <= _MAX_SWEEPS
    if not is_list or not all(type(age) in (int, float) and 0 <= age <= _MAX_AGE_S for age in ages_s):
        raise ValueError(f"sweep_ages_s: must be 1 to {_MAX_SWEEPS} ages from 0 to {_MAX_AGE_S:g} s")
    if sorted(set(ages_s)) != ages_s:
        raise ValueError("sweep_ages_s: must ascend")
    return sweep_ages_ns(ages_s)


def weights_file(modality: Modality) -> Path:
    """File of the weights that come with the package."""
    return WEIGHTS_FOLDER / f"{modality}.onnx"


def require_onnx_runtime() -> None:
    """Raise InputError if ONNX Runtime is not installed."""
    load_extras()["baselines"].require("a baseline")


def open_session(path: Path, threads: int | None = None, *, gpu: bool = True, part: bytes = b"") -> "InferenceSession":
    """Load a model into ONNX Runtime.

    Args:
        path: Its file.
        threads: As for ``Baseline``.
        gpu: As for ``Baseline``.
        part: Loaded instead of the file, of which it is a part; empty: the file.

    Raises:
        InputError: ONNX Runtime is not installed, or the model cannot be loaded.
    """
    require_onnx_runtime()
    import onnxruntime

    if not path.is_file():
        raise InputError(f"{path}: no such file")
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 3
    # Threads that wait do not spin: the graph, and often the simulator's renderer, need the cores as well.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    if threads is not None:
        options.intra_op_num_threads = threads
    available = onnxruntime.get_available_providers()
    wanted = ["CUDAExecutionProvider"] if gpu and "CUDAExecutionProvider" in available else []
    try:
        return onnxruntime.InferenceSession(part or str(path), options, providers=[*wanted, "CPUExecutionProvider"])
    except Exception as error:  # ONNX Runtime's errors have no common base
        raise InputError(f"{path}: cannot be loaded: {str(error).splitlines()[0]}") from None
