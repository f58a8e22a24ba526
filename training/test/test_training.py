"""Training on the CPU: targets fit augmented inputs, all weights learn, runs resume."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cached_scene import CAR, PEDESTRIAN, YAW_RAD, write_cached_scene

torch = pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")
pytest.importorskip("onnx", reason="training needs it: pip install ./training[torch]")

from simbev_ros.baselines.boxes import decode_boxes  # noqa: E402
from simbev_ros.baselines.grid import CELLS, FEATURE_CELLS  # noqa: E402
from simbev_ros.baselines.inference import Baseline  # noqa: E402
from simbev_ros.baselines.modality import Modality  # noqa: E402
from simbev_ros.foundation.errors import InputError  # noqa: E402
from simbev_ros.foundation.semantics import BEV_CLASSES  # noqa: E402
from simbev_training.cache.reader import CachedScene  # noqa: E402
from simbev_training.model.bev_model import BevModel  # noqa: E402
from simbev_training.model.cameras import CameraEncoder, depth_index  # noqa: E402
from simbev_training.model.pillars import CHANNELS, PILLARS, pillar_statistics  # noqa: E402
from simbev_training.training.augmentation import Thinning  # noqa: E402
from simbev_training.training.batches import CachedBatches  # noqa: E402
from simbev_training.training.config import Augmentation, Training, load_training  # noqa: E402
from simbev_training.training.export import ExportedModel, export_model, export_run, models_to_average  # noqa: E402
from simbev_training.training.loop import inputs_of, load_model, train  # noqa: E402
from simbev_training.training.losses import losses_of  # noqa: E402
from simbev_training.training.onnx_weights import read_model, start_from  # noqa: E402
from simbev_training.training.targets import targets_of  # noqa: E402

WILD = Augmentation(rotation_deg=180, scale=0.2, thinning=0, every_second_ring=0)


@pytest.fixture(scope="module", autouse=True)
def one_thread() -> Iterator[None]:
    """Compute with one thread: batches this small are done no sooner with several, which wait for each other."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def batches(cache: Path, modality: Modality, augmentation: Augmentation | None, size: int = 2) -> CachedBatches:
    training = Training(modality=modality, augmentation=augmentation or Augmentation(), batch_size=size, seed=3)
    return CachedBatches([CachedScene(write_cached_scene(cache))], training, augmented=augmentation is not None)


def test_statistics_of_a_pillar_worked_by_hand() -> None:
    newest, earlier = [[10.0, 4.0, 0.5, 0], [10.05, 4.05, 1.5, 0]], [[10.0, 4.0, 0.2, 1], [10.0, 4.0, 1.2, 3]]
    points = torch.tensor([*newest, *earlier, [10.0, 4.0, 0.4, 4], [500.0, 0, 0, 0]])
    statistics = pillar_statistics(points, torch.zeros(len(points), dtype=torch.int64), 1)
    assert statistics.shape == (1, CHANNELS, PILLARS, PILLARS)
    filled = (statistics[0] != 0).any(0).nonzero()
    assert filled.tolist() == [[309, 339], [310, 340]]
    pillar = statistics[0, :, 310, 340]
    occupied, lowest, highest = pillar[:12].reshape(3, 4).tolist()
    assert occupied == [1.0, 1.0, 0.0, 1.0]  # the newest sweep, the one before, none of the next, older ones together
    assert lowest == pytest.approx([0.25, 0.1, 0.0, 0.2])  # over 2 m
    assert highest == pytest.approx([0.25, 0.1, 0.0, 0.6])
    assert pillar[12:14].tolist() == pytest.approx([np.log(2.0), 0.25])


def test_statistics_do_not_depend_on_the_order_of_points() -> None:
    generator = torch.Generator().manual_seed(0)
    points = torch.rand(5000, 4, generator=generator) * torch.tensor([20.0, 20.0, 3.0, 4.99])
    points[:, 3] = points[:, 3].floor()
    order, sample = torch.randperm(5000, generator=generator), torch.zeros(5000, dtype=torch.int64)
    assert torch.equal(pillar_statistics(points, sample, 1), pillar_statistics(points[order], sample, 1))


@pytest.mark.parametrize(
    "augmentation",
    [
        None,
        WILD,
        WILD.model_copy(update={"translation_m": 3.0}),
        WILD.model_copy(update={"tilt_deg": 1.5, "ground_m": 0.5}),
    ],
)
def test_targets_and_inputs_stay_together(tmp_path: Path, augmentation: Augmentation | None) -> None:
    batch = batches(tmp_path, Modality.FUSED, augmentation)[0]
    targets, (points, _) = targets_of(batch), batch.points()
    for _, label, x, y, z, length, width, height, yaw, *_ in batch.boxes[batch.boxes[:, 1] == 0].tolist():
        assert label == 0
        row, column = int((72 - x) / 0.4), int((72 - y) / 0.4)
        assert targets.cells[:, row, column, BEV_CLASSES.index("car")].max() == 1
        offset = points[:, :3] - torch.tensor([x, y, z])
        along = offset[:, 0] * np.cos(yaw) + offset[:, 1] * np.sin(yaw)
        across = offset[:, 1] * np.cos(yaw) - offset[:, 0] * np.sin(yaw)
        inside = (along.abs() < length / 2) & (across.abs() < width / 2) & (offset[:, 2].abs() < height / 2)
        assert int((inside & (points[:, 3] == 0)).sum()) >= 190  # of 200 points in the box
    *_, depth_m = (batch.pixel_from_level[0, 0] @ torch.tensor([*batch.boxes[0, 2:5].tolist(), 1.0])).tolist()
    assert depth_m == pytest.approx(CAR[0], abs=1e-3)  # a warp moves no pixel


def test_a_translation_shifts_boxes_and_leaves_all_other_draws_as_they_are(tmp_path: Path) -> None:
    still, moved = (
        batches(tmp_path / str(sigma_m), Modality.LIDAR, WILD.model_copy(update={"translation_m": sigma_m}))
        for sigma_m in (0.0, 0.5)
    )
    shifts_m = []
    for step in range(40):
        before, after = still[step], moved[step]
        assert torch.allclose(before.warped_from_sweep[..., :3], after.warped_from_sweep[..., :3])
        shifts_m.append((after.boxes[0, 2:5] - before.boxes[0, 2:5]).tolist())
    assert np.std(shifts_m, axis=0) == pytest.approx([0.5] * 3, abs=0.2)


def test_the_same_seed_and_epoch_give_the_same_batch(tmp_path: Path) -> None:
    first, second = (batches(tmp_path / name, Modality.LIDAR, WILD) for name in "ab")
    assert all(torch.equal(a, b) for a, b in zip(first[0], second[0], strict=True))
    assert not torch.equal(first[0].boxes, second[first.steps_per_epoch].boxes)


def test_a_box_survives_its_targets(tmp_path: Path) -> None:
    """Targets taken as the answer decode to the boxes that they were made from."""
    targets = targets_of(batches(tmp_path, Modality.LIDAR, None, size=1)[0])
    peaks = []
    for part in (targets.large, targets.small):
        cells = part.heat.shape[-1]
        values = np.zeros((10, cells * cells), np.float32)
        chosen = part.weight.numpy() > 0
        values[:, part.center.numpy()[chosen]] = part.boxes.numpy()[chosen].T
        heat = np.where(part.heat[0].numpy() >= 1.0, 0.9, 0.0).astype(np.float32)
        peaks.append((heat, values.reshape(10, cells, cells)))
    boxes = decode_boxes(peaks)
    car, pedestrian = (boxes[boxes["class"] == label] for label in (0, 5))
    assert [pedestrian[name].item() for name in ("x", "y", "z")] == pytest.approx(PEDESTRIAN, abs=1e-4)
    assert [car[name].item() for name in ("x", "y", "z")] == pytest.approx(CAR, abs=1e-4)
    assert [car[name].item() for name in ("length", "width", "height")] == pytest.approx([4.0, 2.0, 1.6], rel=1e-5)
    assert car["yaw"].item() == pytest.approx(YAW_RAD, abs=1e-6)
    assert car["vx"].item() == pytest.approx(2.0)


def test_intervals_of_depth_grow_and_cover_the_range() -> None:
    edges = depth_index(torch.tensor([1.0, 97.0, 2.0, 50.0]))
    assert edges.tolist() == pytest.approx([0.0, 48.0, 4.475, 34.15], abs=0.01)


@pytest.mark.parametrize("beside_lidar", [False, True])
def test_a_camera_encoder_takes_nothing_from_a_camera_with_projections_of_zeros(beside_lidar: bool) -> None:
    encoder = CameraEncoder(4, beside_lidar=beside_lidar).eval()
    images, projections = torch.zeros(1, 1, 3, 32, 64), torch.zeros(1, 1, 3, 4)
    black, _ = encoder(images, projections)
    white, _ = encoder(images + 255, projections)
    assert torch.equal(black, white)
    projections[0, 0] = torch.tensor([[16.0, -32, 0, 0], [16, 0, -32, 0], [1, 0, 0, 0]])
    assert not torch.equal(encoder(images + 255, projections)[0], white)


@pytest.mark.slow
@pytest.mark.parametrize(("modality", "size"), [(Modality.CAMERA, 1), (Modality.LIDAR, 2), (Modality.FUSED, 1)])
def test_shapes_and_gradients(tmp_path: Path, modality: Modality, size: int) -> None:
    torch.manual_seed(0)
    batch, model = batches(tmp_path, modality, None, size)[0], BevModel(modality)
    outputs = model(inputs_of(batch, modality))
    assert outputs.cells.shape == (size, len(BEV_CLASSES), CELLS, CELLS)
    assert outputs.heat.shape == (size, 3, FEATURE_CELLS, FEATURE_CELLS)
    assert outputs.small_heat.shape == (size, 3, CELLS, CELLS)
    assert (outputs.depth is not None) == modality.has_cameras
    losses = losses_of(outputs, targets_of(batch), batch.pixel_depth_m() if modality.has_cameras else None)
    sum(losses.values()).backward()
    for name, parameter in model.named_parameters():
        assert parameter.grad is not None, name
        assert torch.isfinite(parameter.grad).all(), name
        assert parameter.grad.abs().max() > 0, name


@pytest.mark.slow
def test_three_steps_on_a_batch_lower_its_loss(tmp_path: Path) -> None:
    torch.manual_seed(0)
    batch, model = batches(tmp_path, Modality.LIDAR, None, size=1)[0], BevModel(Modality.LIDAR)
    optimizer, targets = torch.optim.AdamW(model.parameters(), lr=3e-3), targets_of(batch)
    totals = []
    for _ in range(3):
        losses = losses_of(model(inputs_of(batch, Modality.LIDAR)), targets, None)
        optimizer.zero_grad()
        total = sum(losses.values())
        total.backward()
        optimizer.step()
        totals.append(total.item())
    assert totals[-1] < 0.8 * totals[0]


@pytest.mark.slow
def test_an_interrupted_run_ends_like_one_that_was_not(tmp_path: Path) -> None:
    write_cached_scene(tmp_path, frames=1)
    training = Training(modality=Modality.LIDAR, epochs=2, batch_size=1)

    def run(name: str, stop_after: int) -> None:
        def report(progress: object) -> None:
            if progress.step == stop_after:  # type: ignore[attr-defined]
                raise KeyboardInterrupt

        train(training, [tmp_path], tmp_path / name, device=torch.device("cpu"), workers=0, report=report)

    run("whole", 99)
    with pytest.raises(KeyboardInterrupt):
        run("parts", 2)  # after the checkpoint of the first epoch
    run("parts", 99)
    (_, whole), (_, parts) = (load_model(tmp_path / name / "checkpoint.pt") for name in ("whole", "parts"))
    assert all(torch.equal(a, b) for a, b in zip(whole.state_dict().values(), parts.state_dict().values(), strict=True))
    path = export_run(training, tmp_path / "whole", tmp_path)
    assert Baseline(path).modality is Modality.LIDAR
    once_more = training.model_copy(update={"average_with": (str(path),), "export_weights": "int8"})
    train(
        once_more,
        [tmp_path],
        tmp_path / "whole",
        device=torch.device("cpu"),
        workers=2,
        report=lambda progress: pytest.fail("the run had ended"),
    )
    assert Baseline(export_run(once_more, tmp_path / "whole", tmp_path)).modality is Modality.LIDAR
    with pytest.raises(InputError, match="was made with another epochs; choose another folder"):
        train(
            training.model_copy(update={"epochs": 3}),
            [tmp_path],
            tmp_path / "whole",
            device=torch.device("cpu"),
            workers=0,
            report=lambda progress: None,
        )


@pytest.mark.slow
def test_the_exported_model_answers_like_the_trained_one(tmp_path: Path) -> None:
    torch.manual_seed(0)
    sample, model = (
        CachedScene(write_cached_scene(tmp_path)).sample(1, (0, 250_000_000)),
        BevModel(Modality.FUSED).eval(),
    )
    export_model(model, tmp_path / "model.onnx", {"modality": "fused", "sweep_ages_s": [0, 0.25]}, 6, (64, 32))
    images = np.random.default_rng(0).integers(0, 255, (6, 32, 64, 3), np.uint8)
    answer = Baseline(tmp_path / "model.onnx").answer(sample.points(), images, sample.pixel_from_level)
    with torch.no_grad():
        given = (torch.from_numpy(each) for each in (sample.points(), images, sample.pixel_from_level))
        cells, *_ = ExportedModel(model)(*given)
    assert np.abs(answer.cells.astype(int) - cells.numpy()).max() <= 1  # weights have half precision


@pytest.mark.slow
@pytest.mark.parametrize(("weights", "tolerance", "share"), [("half", 1, 1.0), ("int8", 6, 0.55)])
def test_an_ensemble_answers_with_the_mean(tmp_path: Path, weights: str, tolerance: int, share: float) -> None:
    torch.manual_seed(4)
    sample = CachedScene(write_cached_scene(tmp_path)).sample(1, (0, 250_000_000))
    fused, lidar = (BevModel(modality).eval() for modality in (Modality.FUSED, Modality.LIDAR))
    for model, logit in ((fused, 0.5), (lidar, -1.0)):
        torch.nn.init.constant_(model.heads.cells[-1].bias, logit)
    about, files = {"modality": "fused", "sweep_ages_s": [0, 0.25]}, [tmp_path / "alone.onnx", tmp_path / "both.onnx"]
    export_model(fused, files[0], about, 6, (64, 32))
    export_model(fused, files[1], about, 6, (64, 32), others=[lidar], weights=weights)
    images = np.random.default_rng(0).integers(0, 255, (6, 32, 64, 3), np.uint8)
    alone, both = (Baseline(file).answer(sample.points(), images, sample.pixel_from_level) for file in files)
    with torch.no_grad():
        given = [torch.from_numpy(each) for each in (sample.points(), images, sample.pixel_from_level)]
        cells, *_ = ExportedModel(fused, [lidar])(*given)
    off = np.abs(both.cells.astype(int) - cells.numpy())
    assert off.max() <= tolerance
    assert np.abs(alone.cells.astype(int) - cells.numpy()).max() > 2 * tolerance
    both_bytes = sum(each.numel() for model in (fused, lidar) for each in model.parameters()) * 2
    assert files[1].stat().st_size < share * both_bytes + 200_000
    back, read = read_model(files[1])
    assert read == about
    for name, each in fused.named_parameters():
        step = each.abs().max() / 127 if weights == "int8" and each.ndim > 1 else each.abs().max() / 1000
        assert (back.get_parameter(name) - each).abs().max() <= step, name


@pytest.mark.slow
@pytest.mark.parametrize(
    ("about", "message"),
    [
        (
            {"modality": "fused", "sweep_ages_s": [0.0]},
            "is a fused model; a lidar model does not see all that it needs",
        ),
        ({"modality": "lidar"}, "is not a baseline of simbev_ros"),
        ({"modality": "lidar", "sweep_ages_s": [0.0, 0.5]}, r"takes sweeps of \[0.0, 0.5\] s; sweep_ages_s is \[0.0\]"),
    ],
)
def test_a_model_that_cannot_be_averaged_with_is_named(tmp_path: Path, about: dict[str, Any], message: str) -> None:
    file = tmp_path / "other.onnx"
    export_model(BevModel(Modality(about["modality"])).eval(), file, about, 6, (64, 32))
    training = Training(modality=Modality.LIDAR, sweep_ages_s=(0.0,), average_with=(str(file),))
    with pytest.raises(InputError, match=rf"average_with: .*other\.onnx: {message}"):
        models_to_average(training)


def test_a_run_goes_on_with_another_export() -> None:
    begun = Training(modality=Modality.FUSED)
    assert begun.differing(begun.model_copy(update={"average_with": ("lidar",), "export_weights": "int8"})) == []
    assert begun.differing(begun.model_copy(update={"epochs": 3, "seed": 1})) == ["seed", "epochs"]


def test_a_model_starts_with_all_weights_of_its_export(tmp_path: Path) -> None:
    torch.manual_seed(2)
    model, started = BevModel(Modality.LIDAR).eval(), BevModel(Modality.LIDAR)
    block = model.trunk.middle[0]
    for each in (block.second[1], block.shortcut[1]):  # they learn the same
        torch.nn.init.constant_(each.bias, 0.5)
    export_model(model, tmp_path / "model.onnx", {"modality": "lidar", "sweep_ages_s": [0]}, 6, (64, 32))
    start_from(started, [tmp_path / "model.onnx"])
    after = started.state_dict()
    for name, weights in model.state_dict().items():
        assert torch.allclose(after[name].float(), weights.float(), rtol=1e-3, atol=1e-4), name


def test_a_fused_model_starts_from_exported_ones(tmp_path: Path) -> None:
    torch.manual_seed(1)
    lidar, fused = BevModel(Modality.LIDAR).eval(), BevModel(Modality.FUSED)
    before = {name: each.clone() for name, each in fused.state_dict().items()}
    file = tmp_path / "lidar.onnx"
    export_model(lidar, file, {"modality": "lidar", "sweep_ages_s": [0]}, 6, (64, 32))
    start_from(fused, [file])
    given, after = lidar.state_dict(), fused.state_dict()
    taken = {name for name, each in after.items() if not torch.equal(each, before[name])}
    assert {name.split(".")[0] for name in taken} == {"lidar", "trunk", "heads"}
    parameters = {name for name, _ in lidar.named_parameters() if given[name].ndim > 1}
    assert parameters <= taken
    assert all(torch.allclose(after[name], given[name], rtol=1e-3, atol=1e-4) for name in parameters)  # half precision


@pytest.mark.parametrize(
    ("content", "message"),
    [(None, "no such file"), (b"none", "cannot be read"), (b"", "has no weights of this model")],
)
def test_a_file_to_start_from_that_is_no_model_is_named(tmp_path: Path, content: bytes | None, message: str) -> None:
    file = tmp_path / "model.onnx"
    if content is not None:
        file.write_bytes(content)
    write_cached_scene(tmp_path)
    training = Training(modality=Modality.LIDAR, batch_size=1, start_from=(str(file),))
    with pytest.raises(InputError, match=rf"model\.onnx: {message}"):
        train(
            training, [tmp_path], tmp_path / "run", device=torch.device("cpu"), workers=0, report=lambda progress: None
        )


@pytest.mark.parametrize("workers", [0, 1])
def test_a_damaged_cache_ends_training_with_one_line(tmp_path: Path, workers: int) -> None:
    folder = write_cached_scene(tmp_path)
    np.save(folder / "points.npy", np.load(folder / "points.npy")[:-1])
    training = Training(modality=Modality.LIDAR, batch_size=1, augmentation=Augmentation(pasting=0.0))
    with pytest.raises(InputError, match=rf"\A{folder}: cannot be read: points has \d+ rows, [^\n]*\Z"):
        train(
            training,
            [tmp_path],
            tmp_path / "run",
            device=torch.device("cpu"),
            workers=workers,
            report=lambda progress: None,
        )


def test_files_to_start_from_are_relative_to_the_configuration(tmp_path: Path) -> None:
    config = tmp_path / "mine.yaml"
    config.write_text("modality: fused\nstart_from: [lidar, runs/model.onnx]\n", encoding="utf-8")
    assert load_training(config).start_from == ("lidar", str(tmp_path / "runs/model.onnx"))


def test_a_checkpoint_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "checkpoint.pt").write_bytes(b"nothing")
    with pytest.raises(InputError, match=r"checkpoint\.pt: is not a checkpoint"):
        load_model(tmp_path / "checkpoint.pt")


def test_thinning_leaves_out_another_share_of_the_points_of_each_sample(tmp_path: Path) -> None:
    whole = len(batches(tmp_path / "whole", Modality.LIDAR, None)[0].points_cm)
    thinned = batches(tmp_path / "thinned", Modality.LIDAR, Augmentation(thinning=0.6, every_second_ring=0))
    shares = np.array([len(thinned[step].points_cm) for step in range(40)]) / whole
    assert 0.4 < shares.min() < 0.55
    assert 0.85 < shares.max() < 1


def test_a_coarse_lidar_has_every_second_ring(tmp_path: Path) -> None:
    elevation_deg = np.repeat(np.linspace(10.67, -30.67, 128), 256)
    azimuth_rad = np.tile(np.linspace(-np.pi, np.pi, 256), 128)
    ahead = np.cos(np.radians(elevation_deg))
    rays = np.column_stack(
        [ahead * np.cos(azimuth_rad), ahead * np.sin(azimuth_rad), np.sin(np.radians(elevation_deg))]
    )
    points_cm = np.rint(100 * (rays * np.random.default_rng(0).uniform(20, 60, (len(rays), 1)) + [0, 0, 1.8]))
    whole = CachedScene(write_cached_scene(tmp_path)).sample(0, (0,))
    sample = replace(whole, sweeps_cm=(points_cm.astype(np.int16),))
    thinning = Thinning(share=0.0, coarse=True, phase=0.3)
    [kept] = thinning.sweeps(sample, np.random.default_rng(0))
    ring = np.rint((10.67 - np.degrees(np.arctan2(kept[:, 2] - 180, np.hypot(kept[:, 0], kept[:, 1])))) * 127 / 41.34)
    rings, counts = np.unique(ring, return_counts=True)
    assert len(rings) == 64
    assert set(np.diff(rings)) == {2}
    assert set(counts) == {256}
    [all_rings] = thinning.sweeps(replace(sample, ring_deg=0.0), np.random.default_rng(0))
    assert len(all_rings) == len(points_cm)  # where rings lie is not known


def test_one_sweep_and_no_points_nearby_are_drawn_for_each_sample(tmp_path: Path) -> None:
    still = Augmentation(thinning=0, every_second_ring=0, flip=False, rotation_deg=0, scale=0, pasting=0)
    drawn = batches(tmp_path, Modality.LIDAR, still.model_copy(update={"one_sweep": 0.5, "near_m": 6.0}), size=1)
    nearest_m, alone = [], []
    for step in range(0, 80, 2):
        batch = drawn[step]
        nearest_m.append(np.hypot(*batch.points_cm[: batch.points_of_sweep[0, 0], :2].numpy().T).min() / 100)
        alone.append(int((batch.points_of_sweep[0] > 0).sum()) == 1)
    assert np.mean(alone[1:]) > 0.25 and not all(alone)
    assert np.min(nearest_m) < 1.5 and 4.5 < np.max(nearest_m) < 6.5


def test_boxes_with_few_points_are_neither_learned_nor_wrong(tmp_path: Path) -> None:
    scenes = [CachedScene(write_cached_scene(tmp_path))]
    few, enough = (
        targets_of(
            CachedBatches(scenes, Training(modality=Modality.LIDAR, batch_size=1, min_points=each), augmented=False)[0]
        )
        for each in (21, 20)
    )
    assert few.large.weight.sum() == few.small.weight.sum() == 0
    assert few.small.heat.max() == few.large.heat.max() == 0
    assert torch.equal(few.small.open, enough.small.heat) and torch.equal(few.large.open, enough.large.heat)
    assert enough.small.weight.sum() == 1 and enough.small.open.max() == 0


def test_cameras_are_missing_from_some_samples(tmp_path: Path) -> None:
    plain = Augmentation(flip=False, rotation_deg=0, scale=0, pasting=0)
    drawn = batches(tmp_path, Modality.FUSED, plain.model_copy(update={"missing_cameras": 0.5}), size=1)
    seen = []
    for step in range(30):
        batch = drawn[step]
        has_projection = batch.pixel_from_level[0].abs().amax((1, 2)) > 0
        assert torch.equal(has_projection, batch.images[0].amax((1, 2, 3)) > 0)
        assert torch.equal(has_projection, batch.depth_m[0].amax((1, 2)) > 0)
        seen.append(int(has_projection.sum()))
    assert 8 <= sum(count == 6 for count in seen) <= 22 and min(seen) <= 3
