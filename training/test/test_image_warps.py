"""Images that are mirrored, rotated and zoomed show things where their changed projections say."""

import numpy as np
import pytest

torch = pytest.importorskip("torch", reason="training needs it: pip install ./training[torch]")

from simbev_ros.foundation.types import AnyArray, Float64Array  # noqa: E402
from simbev_training.training.config import Augmentation  # noqa: E402
from simbev_training.training.image_warps import (  # noqa: E402
    draw_image_warps,
    unit_from_pixel,
    warped_images,
)

SIZE_PX = WIDTH_PX, HEIGHT_PX = 96, 48
WARPS = draw_image_warps(Augmentation(zoom=0.2, image_rotation_deg=10), 12, SIZE_PX, np.random.default_rng(1))


def warped(images: AnyArray, warps: Float64Array, mode: str) -> AnyArray:
    """(K, h, w) warped gray images."""
    unit = unit_from_pixel(SIZE_PX)
    recorded_from_warped = torch.from_numpy((unit @ np.linalg.inv(unit @ warps)).astype(np.float32))
    given = torch.from_numpy(images.astype(np.float32))[None, :, None]
    return np.asarray(warped_images(given, recorded_from_warped[None], mode)[0, :, 0])


def test_a_spot_is_where_its_projection_is() -> None:
    x, y = np.meshgrid(np.arange(WIDTH_PX), np.arange(HEIGHT_PX))
    spot = 60.0, 17.0
    images = warped(
        np.tile(np.exp(-((x - spot[0]) ** 2 + (y - spot[1]) ** 2) / 8), (len(WARPS), 1, 1)), WARPS, "bilinear"
    )
    weight = images / images.sum((1, 2), keepdims=True)
    found = np.stack([(weight * x).sum((1, 2)), (weight * y).sum((1, 2))], 1)
    np.testing.assert_allclose(found, (WARPS @ [*spot, 1.0])[:, :2], atol=0.1)


def test_half_of_the_images_is_mirrored_and_none_is_when_switched_off() -> None:
    sides = np.sign(np.linalg.det(WARPS[:, :2, :2]))
    assert 0 < (sides < 0).sum() < len(WARPS)
    still = draw_image_warps(
        Augmentation(flip=False, zoom=0, image_rotation_deg=0), 3, SIZE_PX, np.random.default_rng()
    )
    np.testing.assert_allclose(still, np.tile(np.eye(3), (3, 1, 1)), atol=1e-12)


def test_depth_of_patches_goes_with_the_image() -> None:
    patches = np.arange(1.0, 73.0).reshape(6, 12)
    depth = warped(np.tile(patches, (len(WARPS), 1, 1)), WARPS, "nearest")
    for warp, image in zip(WARPS, depth, strict=True):
        for row, column in np.ndindex(6, 12):
            u, v, _ = np.linalg.inv(warp) @ [8 * column + 3.5, 8 * row + 3.5, 1.0]
            inside = (-0.5 <= u < WIDTH_PX - 0.5) and (-0.5 <= v < HEIGHT_PX - 0.5)
            expected = patches[int((v + 0.5) // 8), int((u + 0.5) // 8)] if inside else 0.0
            on_edge = min((u + 0.5) % 8, 8 - (u + 0.5) % 8, (v + 0.5) % 8, 8 - (v + 0.5) % 8) < 1e-3
            assert on_edge or image[row, column] == expected
