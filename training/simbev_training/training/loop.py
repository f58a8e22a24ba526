"""The training loop: AdamW with a cosine schedule, mixed precision, a moving average of weights, resumable."""

import math
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from tensorboardX import SummaryWriter
from torch import nn
from torch.utils.data import DataLoader

from simbev_ros.baselines.modality import Modality
from simbev_ros.baselines.model_file import model_file
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_training.cache.reader import cached_scenes
from simbev_training.model.bev_model import BevModel, Inputs
from simbev_training.training.batches import Batch, CachedBatches
from simbev_training.training.config import Training
from simbev_training.training.losses import losses_of
from simbev_training.training.onnx_weights import start_from
from simbev_training.training.targets import targets_of

CHECKPOINT_FILE = "checkpoint.pt"
_WARM_UP_SHARE = 0.05
_MAX_GRADIENT = 10.0
_LOG_STEPS = 20


@dataclass(frozen=True)
class Progress:
    """Progress of a run: done and all steps, and the newest losses by name."""

    step: int
    steps: int
    losses: dict[str, float]


def train(
    training: Training,
    caches: Sequence[Path],
    out: Path,
    *,
    device: torch.device,
    workers: int,
    report: Callable[[Progress], None],
) -> None:
    """Train a baseline, or resume from its checkpoint in ``out``; the folder then holds the final checkpoint.

    Args:
        training: The configuration.
        caches: Caches of the datasets.
        out: Folder of the run.
        device: Where to train.
        workers: Processes that make batches; 0: none.
        report: Called every few steps.

    Raises:
        InputError: The caches have too few samples, the checkpoint is of another configuration, a model to start from
            does not fit, or a compiler is missing.
    """
    torch.manual_seed(training.seed)
    path = out / CHECKPOINT_FILE
    model = BevModel(training.modality)
    start_from(model, starting_files(training, out))
    model.to(device, memory_format=torch.channels_last)
    average = deepcopy(model).eval().requires_grad_(False)
    if device.type == "cuda" and training.compile:
        _require_compiler()
        model.compile_parts()
    optimizer = torch.optim.AdamW(_groups(model, training), lr=training.learning_rate, fused=device.type == "cuda")
    scenes = [scene for cache in caches for scene in cached_scenes(cache, "train")[: training.scenes]]
    data = CachedBatches(scenes, training)
    if not data.steps_per_epoch:
        raise InputError(f"{caches[-1]}: has fewer samples to train on than batch_size {training.batch_size}")
    steps, step = training.epochs * data.steps_per_epoch, 0
    out.mkdir(parents=True, exist_ok=True)
    if path.exists():
        step = _resume(path, training, model, average, optimizer)
    moving_average = _MovingAverage(average, model)
    with SummaryWriter(str(out / "log"), purge_step=step) as writer:
        log = _Log(writer, training.batch_size, step)
        for batch in _on_device(_batches(data, range(step, steps), workers, device), device):
            for group in optimizer.param_groups:
                group["lr"] = training.learning_rate * _schedule(step / steps)
            losses = _step(model, optimizer, batch, training.modality)
            moving_average.update(min(training.average_decay, (1 + step) / (10 + step)))
            step += 1
            if step % _LOG_STEPS == 0 or step == steps:
                report(Progress(step, steps, log.write(step, step / data.steps_per_epoch, losses)))
            if step % data.steps_per_epoch == 0:
                save_checkpoint(path, training, model, average, optimizer, step)


def starting_files(training: Training, out: Path) -> list[Path]:
    """Models from which a run starts; none if it resumes from its checkpoint.

    Raises:
        InputError: There is no such file.
    """
    if (out / CHECKPOINT_FILE).exists():
        return []
    try:
        return [model_file(each) for each in training.start_from]
    except InputError as error:
        raise InputError(f"start_from: {error}") from None


def save_checkpoint(
    path: Path, training: Training, model: nn.Module, average: nn.Module, optimizer: torch.optim.Optimizer, step: int
) -> None:
    """Write a checkpoint atomically: a run that is killed leaves the one before."""
    making = path.with_suffix(".making")
    state = {
        "training": training.model_dump(mode="json"),
        "step": step,
        "model": model.state_dict(),
        "average": average.state_dict(),
        "optimizer": optimizer.state_dict(),
    }
    torch.save(state, making)
    making.replace(path)


def load_model(path: Path) -> tuple[Training, BevModel]:
    """Configuration and averaged weights of a checkpoint, on the CPU.

    Raises:
        InputError: It cannot be read.
    """
    training, state = _load(path)
    model = BevModel(training.modality).eval()
    with foreign_content(path):
        model.load_state_dict(state["average"])
    return training, model


def inputs_of(batch: Batch, modality: Modality) -> Inputs:
    """The part of a batch that a model sees."""
    points, sample = batch.points() if modality.has_lidar else (None, None)
    return Inputs(
        points=points,
        sample=sample,
        images=batch.pixels() if modality.has_cameras else None,
        pixel_from_level=batch.pixel_from_level if modality.has_cameras else None,
        samples=len(batch.cells),
    )


def _step(
    model: nn.Module, optimizer: torch.optim.Optimizer, batch: Batch, modality: Modality
) -> dict[str, torch.Tensor]:
    """One step of the optimizer; returns the losses before it."""
    device_type = batch.cells.device.type
    inputs = inputs_of(batch, modality)  # with full precision: positions need it
    with torch.autocast(device_type, torch.bfloat16, enabled=device_type == "cuda"):
        outputs = model(inputs)
    losses = losses_of(outputs, targets_of(batch), batch.pixel_depth_m() if modality.has_cameras else None)
    optimizer.zero_grad(set_to_none=True)
    torch.stack(list(losses.values())).sum().backward()
    nn.utils.clip_grad_norm_([each for group in optimizer.param_groups for each in group["params"]], _MAX_GRADIENT)
    optimizer.step()
    return {name: value.detach() for name, value in losses.items()}


def _batches(data: CachedBatches, steps: range, workers: int, device: torch.device) -> Iterator[Batch]:
    workers = min(workers, len(steps))
    loader = DataLoader(
        data,
        batch_size=None,
        sampler=steps,
        num_workers=workers,
        pin_memory=device.type == "cuda",
        prefetch_factor=4 if workers else None,
        worker_init_fn=_one_thread,
    )
    try:
        yield from loader
    except InputError as error:  # that of a process of the loader has a traceback before its message
        raise InputError(str(error).rpartition(f"{InputError.__name__}: ")[2].strip()) from None


def _require_compiler() -> None:
    if not any(map(shutil.which, (os.environ.get("CC", "gcc"), "gcc", "clang"))):
        raise InputError("compile: needs gcc or clang, which this machine lacks; set it to false to train without")


def _on_device(batches: Iterable[Batch], device: torch.device) -> Iterator[Batch]:
    """Copy batches to a device; a GPU copies the next one while it works on the last."""
    if device.type != "cuda":
        yield from (batch.to(device) for batch in batches)
        return
    copying, working = torch.cuda.Stream(device), torch.cuda.current_stream(device)
    last: tuple[Batch, torch.cuda.Event] | None = None
    for batch in batches:
        with torch.cuda.stream(copying):
            following = batch.to(device), copying.record_event()
        if last is not None:
            yield _copied(last, working)
        last = following
    if last is not None:
        yield _copied(last, working)


def _copied(copy: tuple[Batch, torch.cuda.Event], working: torch.cuda.Stream) -> Batch:
    """Let a stream wait for a copy, and use the copy's memory from then on."""
    batch, done = copy
    working.wait_event(done)
    for each in batch:
        each.record_stream(working)
    return batch


def _one_thread(_: int) -> None:
    torch.set_num_threads(1)


def _groups(model: nn.Module, training: Training) -> list[dict[str, Any]]:
    """Parameters with decay, and those of normalization and biases without."""
    decayed = [each for each in model.parameters() if each.ndim > 1]
    others = [each for each in model.parameters() if each.ndim <= 1]
    return [{"params": decayed, "weight_decay": training.weight_decay}, {"params": others, "weight_decay": 0.0}]


def _schedule(share: float) -> float:
    """Factor of the learning rate after a share of all steps."""
    if share < _WARM_UP_SHARE:
        return (share + 1e-3) / (_WARM_UP_SHARE + 1e-3)
    return 0.5 * (1.0 + math.cos(math.pi * (share - _WARM_UP_SHARE) / (1.0 - _WARM_UP_SHARE)))


class _Log:
    """Scalars for TensorBoard: losses, epoch and speed."""

    def __init__(self, writer: SummaryWriter, batch_size: int, step: int) -> None:
        self._writer, self._batch_size = writer, batch_size
        self._step, self._time_s = step, time.perf_counter()

    def write(self, step: int, epoch: float, losses: dict[str, torch.Tensor]) -> dict[str, float]:
        """Write the values of a step; return losses and samples per second since the last time."""
        values = dict(zip(losses, torch.stack(list(losses.values())).tolist(), strict=True))
        if not all(map(math.isfinite, values.values())):
            raise FloatingPointError(f"step {step}: the loss is not finite: {values}")
        now_s = time.perf_counter()
        values["samples_per_s"] = (step - self._step) * self._batch_size / (now_s - self._time_s)
        self._step, self._time_s = step, now_s
        for name, value in {**values, "epoch": epoch}.items():
            self._writer.add_scalar(name, value, step)
        return values


class _MovingAverage:
    """The moving average of a model's weights and statistics; counters are copied."""

    def __init__(self, average: nn.Module, model: nn.Module) -> None:
        ours, new = ([*each.parameters(), *each.buffers()] for each in (average, model))
        pairs = list(zip(ours, new, strict=True))
        self._moving = [pair for pair in pairs if pair[0].is_floating_point()]
        self._copied = [pair for pair in pairs if not pair[0].is_floating_point()]

    @torch.no_grad()
    def update(self, decay: float) -> None:
        """Move it towards the model."""
        torch._foreach_lerp_([a for a, _ in self._moving], [b for _, b in self._moving], 1.0 - decay)
        torch._foreach_copy_([a for a, _ in self._copied], [b for _, b in self._copied])


def _resume(
    path: Path, training: Training, model: nn.Module, average: nn.Module, optimizer: torch.optim.Optimizer
) -> int:
    begun, state = _load(path)
    if differing := begun.differing(training):
        raise InputError(f"{path}: was made with another {', '.join(differing)}; choose another folder for this run")
    with foreign_content(path):
        model.load_state_dict(state["model"])
        average.load_state_dict(state["average"])
        optimizer.load_state_dict(state["optimizer"])
        return int(state["step"])


def _load(path: Path) -> tuple[Training, dict[str, Any]]:
    """Configuration and state of a checkpoint."""
    try:
        state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        training = Training.model_validate(state["training"])
    except Exception as error:  # torch raises many kinds for a damaged file
        raise InputError(f"{path}: is not a checkpoint: {' '.join(str(error).split()):.200}") from None
    return training, state
