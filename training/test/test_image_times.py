"""Images of several times: earlier ones are seen from the newest frame, and learning starts from one time."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cached_scene import CAMERAS, CAR, write_cached_scene

torch = pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")
pytest.importorskip("onnx", reason="training needs it: pip install ./training[torch]")

from pydantic import ValidationError  # noqa: E402

from simbev_ros.baselines.inference import Baseline  # noqa: E402
from simbev_ros.baselines.modality import Modality  # noqa: E402
from simbev_ros.baselines.model_file import load_baseline  # noqa: E402
from simbev_ros.foundation.errors import InputError  # noqa: E402
from simbev_training.cache.reader import CachedScene  # noqa: E402
from simbev_training.model.bev_model import BevModel  # noqa: E402
from simbev_training.model.cameras import CameraEncoder  # noqa: E402
from simbev_training.training.batches import Batch, CachedBatches  # noqa: E402
from simbev_training.training.config import Augmentation, Training  # noqa: E402
from simbev_training.training.export import export_model, export_run, models_to_average  # noqa: E402
from simbev_training.training.loop import load_model, train  # noqa: E402
from simbev_training.training.onnx_weights import read_model, start_from  # noqa: E402

AGES_S, AGES_NS = (0.0, 0.25), (0, 250_000_000)
ABOUT = {"modality": "camera", "sweep_ages_s": [0.0], "image_ages_s": [0.0, 0.25]}
STILL = Augmentation(flip=False, rotation_deg=0, scale=0, zoom=0, image_rotation_deg=0, pasting=0, one_image=0)


@pytest.fixture
def scene(tmp_path: Path) -> CachedScene:
    """Three frames, between which the ego drives 5 m ahead, each with images of its own gray."""
    import cv2

    folder = write_cached_scene(tmp_path, frames=3)
    gray = [cv2.imencode(".jpg", np.full((32, 64, 3), value, np.uint8))[1].ravel() for value in (50, 100, 150)]
    jpegs = [each for each in gray for _ in range(CAMERAS)]
    np.save(folder / "images.npy", np.concatenate(jpegs))
    np.save(folder / "image_ends.npy", np.cumsum([len(each) for each in jpegs]).reshape(3, CAMERAS))
    depth = np.load(folder / "depth.npy")
    depth[:] = np.array([500, 1000, 1500], np.uint16)[:, None, None, None]
    np.save(folder / "depth.npy", depth)
    return CachedScene(folder)


def batch_of(scene: CachedScene, step: int = 0, **changes: Any) -> Batch:
    training = Training(
        modality=Modality.CAMERA, image_ages_s=AGES_S, batch_size=1, augmentation=STILL.model_copy(update=changes)
    )
    return CachedBatches([scene], training)[step]


def test_earlier_images_follow_the_newest_and_are_projected_to_from_its_frame(scene: CachedScene) -> None:
    sample = scene.sample(2, (0,), AGES_NS)
    assert sample.images()[:, 0, 0, 0].tolist() == [150] * CAMERAS + [100] * CAMERAS
    assert sample.depth_m[:, 0, 0].tolist() == [15.0] * CAMERAS + [10.0] * CAMERAS
    earlier = scene.sample(1, (0,))
    point, moved = np.array([*CAR, 1.0]), np.array([CAR[0] + 5.0, *CAR[1:], 1.0])  # 5 m farther from where the ego was
    np.testing.assert_allclose(sample.pixel_from_level[CAMERAS:] @ point, earlier.pixel_from_level @ moved, atol=1e-3)
    np.testing.assert_array_equal(sample.pixel_from_level[:CAMERAS], scene.sample(2, (0,)).pixel_from_level)


@pytest.mark.parametrize(("index", "ages_ns"), [(0, AGES_NS), (2, (0, 400_000_000)), (1, (0, 500_000_000))])
def test_images_that_were_not_taken_are_black_and_see_nothing(
    scene: CachedScene, index: int, ages_ns: tuple[int, ...]
) -> None:
    sample = scene.sample(index, (0,), ages_ns)
    assert sample.images().shape[0] == 2 * CAMERAS
    for each in (sample.images(), sample.pixel_from_level, sample.depth_m):
        assert not each[CAMERAS:].any() and each[:CAMERAS].any()


@pytest.mark.parametrize("beside_lidar", [False, True])
def test_an_encoder_that_ignores_earlier_images_gives_what_one_without_them_gives(
    scene: CachedScene, beside_lidar: bool
) -> None:
    torch.manual_seed(0)
    one, two = (CameraEncoder(4, beside_lidar=beside_lidar, times=times).eval() for times in (1, 2))
    weights = one.state_dict()
    inputs = weights["mix.0.0.weight"].shape[1]
    wide = torch.zeros_like(two.mix[0][0].weight)
    wide[:, :inputs] = weights["mix.0.0.weight"]
    two.load_state_dict(weights | {"mix.0.0.weight": wide})
    projections = torch.from_numpy(scene.sample(2, (0,), AGES_NS).pixel_from_level)[None]
    images = torch.rand(1, 2 * CAMERAS, 3, 32, 64) * 255
    with torch.no_grad():
        wanted, depth = one(images[:, :CAMERAS], projections[:, :CAMERAS])
        given, depths = two(images, projections)
        earlier, _ = one(images[:, CAMERAS:], projections[:, CAMERAS:])
        two.mix[0][0].weight.copy_(wide.roll(inputs, 1))  # now only the earlier ones count
        swapped, _ = two(images, projections)
    torch.testing.assert_close(given, wanted)
    torch.testing.assert_close(depths[:, :CAMERAS], depth)
    torch.testing.assert_close(swapped, earlier)
    assert not torch.allclose(swapped, wanted)


def test_samples_of_a_batch_do_not_mix(scene: CachedScene) -> None:
    torch.manual_seed(0)
    encoder = CameraEncoder(4, beside_lidar=False, times=2).eval()
    projections = torch.from_numpy(scene.sample(2, (0,), AGES_NS).pixel_from_level)[None].repeat(2, 1, 1, 1)
    images = torch.rand(2, 2 * CAMERAS, 3, 32, 64) * 255
    with torch.no_grad():
        both, _ = encoder(images, projections)
        for each in range(2):
            alone, _ = encoder(images[each : each + 1], projections[each : each + 1])
            torch.testing.assert_close(both[each : each + 1], alone)


def test_earlier_images_are_left_out_of_some_samples_and_missing_cameras_at_all_times(scene: CachedScene) -> None:
    alone, missing = 0, 0
    for step in range(60):
        batch = batch_of(scene, step, one_image=0.3, missing_cameras=0.3)
        newest, earlier = (batch.pixel_from_level[0].abs().amax((1, 2)) > 0).reshape(2, CAMERAS)
        for each in (batch.images[0].amax((1, 2, 3)), batch.depth_m[0].amax((1, 2))):
            assert torch.equal(each.reshape(2, CAMERAS) > 0, torch.stack([newest, earlier]))
        if earlier.any():
            assert torch.equal(newest, earlier)
        alone, missing = alone + int(newest.all() and not earlier.any()), missing + int(not newest.all())
    assert 15 <= alone <= 45 and missing >= 5  # the first frame of three has no earlier one


def test_a_warp_moves_points_and_earlier_images_alike(scene: CachedScene) -> None:
    wild = {"rotation_deg": 180.0, "flip": True, "scale": 0.2}
    for step in range(9):
        batch = batch_of(scene, step, **wild)
        x, y, z = batch.boxes[batch.boxes[:, 1] == 0][0, 2:5].tolist()
        depth_m = (batch.pixel_from_level[0, :, 2] @ torch.tensor([x, y, z, 1.0])).tolist()
        assert depth_m[0] == pytest.approx(CAR[0], abs=1e-3)
        if batch.pixel_from_level[0, CAMERAS:].any():
            assert depth_m[CAMERAS] == pytest.approx(CAR[0] + 5.0, abs=1e-3)


def test_a_model_starts_as_one_that_ignores_earlier_images(tmp_path: Path) -> None:
    torch.manual_seed(0)
    one, two = BevModel(Modality.CAMERA).eval(), BevModel(Modality.CAMERA, times=2)
    export_model(one, tmp_path / "one.onnx", {"modality": "camera", "sweep_ages_s": [0.0]}, CAMERAS, (64, 32))
    start_from(two, [tmp_path / "one.onnx"])
    after, inputs = two.state_dict(), one.state_dict()["cameras.mix.0.0.weight"].shape[1]
    for name, weights in one.state_dict().items():
        given = after[name][:, :inputs] if name == "cameras.mix.0.0.weight" else after[name]
        assert torch.allclose(given.float(), weights.float(), rtol=1e-3, atol=1e-4), name
    assert after["cameras.mix.0.0.weight"].shape[1] == 2 * inputs
    assert not after["cameras.mix.0.0.weight"][:, inputs:].any()


@pytest.mark.slow
def test_a_run_with_earlier_images_is_exported_and_answers(tmp_path: Path, scene: CachedScene) -> None:
    one = BevModel(Modality.CAMERA).eval()
    export_model(one, tmp_path / "one.onnx", {"modality": "camera", "sweep_ages_s": [0.0]}, CAMERAS, (64, 32))
    training = Training(
        modality=Modality.CAMERA,
        image_ages_s=AGES_S,
        epochs=1,
        batch_size=3,
        start_from=(str(tmp_path / "one.onnx"),),
        augmentation=STILL,
    )
    train(training, [tmp_path], tmp_path / "run", device=torch.device("cpu"), workers=0, report=lambda _: None)
    _, trained = load_model(tmp_path / "run/checkpoint.pt")
    assert trained.state_dict()["cameras.mix.0.0.weight"][:, 192:].any()  # earlier images are learned from
    file = export_run(training, tmp_path / "run", tmp_path)
    baseline = Baseline(file)
    assert (baseline.cameras, baseline.image_ages_ns) == (CAMERAS, AGES_NS)
    sample = scene.sample(1, (0,), baseline.image_ages_ns)
    assert baseline.answer(None, sample.images(), sample.pixel_from_level).cells.any()
    back, _ = read_model(file)
    assert back.times == 2
    assert load_baseline(Modality.CAMERA, file).image_ages_ns == AGES_NS
    other = training.model_copy(update={"image_ages_s": (0.0,), "average_with": (str(file),)})
    with pytest.raises(InputError, match=r"takes images of \[0.0, 0.25\] s; image_ages_s is \[0.0\]"):
        models_to_average(other)


@pytest.mark.slow
def test_images_that_do_not_divide_by_times_are_refused(tmp_path: Path) -> None:
    about = ABOUT | {"image_ages_s": [0.0, 0.25, 0.5, 1.0]}
    export_model(BevModel(Modality.CAMERA).eval(), tmp_path / "model.onnx", about, CAMERAS, (64, 32))
    with pytest.raises(InputError, match=r"images: have the shape \[6, 32, 64, 3\], which are not those of 4 times"):
        Baseline(tmp_path / "model.onnx")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"image_ages_s": (0.5, 1.0)}, "must begin with 0 and ascend"),
        ({"image_ages_s": (0.0, 11.0)}, "less than or equal to 10"),
        ({"image_ages_s": AGES_S, "augmentation": Augmentation()}, "augmentation.pasting must be 0"),
    ],
)
def test_times_that_cannot_be_trained_are_refused(fields: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Training(modality=Modality.CAMERA, **fields)
    if "augmentation" in fields:
        Training(modality=Modality.LIDAR, **fields)
