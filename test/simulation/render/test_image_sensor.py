"""Images as cameras form them, against what optics and electrons say about patches and edges."""

import numpy as np
import pytest

from simbev_ros.config.optics import Imager, Optics
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.simulation.render.image_sensor import develop, expose

CLEAN = {"blur_px": 0.0, "glare": 0.0, "read_sigma_electrons": 0.0, "full_well_electrons": 1e7}


def patch(color: tuple[int, int, int], size: tuple[int, int] = (64, 96)) -> UInt8Array:
    return np.full((*size, 3), color, np.uint8)


def formed(image: UInt8Array, seed: int = 1, **settings: object) -> np.ndarray:
    imager = Imager.model_validate(CLEAN | settings)
    return develop(expose(image, imager, seed), imager).astype(np.float64)


def linear(gray: float) -> float:
    """Light of a gray level by sRGB's curve."""
    share = gray / 255.0
    return share / 12.92 if share <= 0.04045 else ((share + 0.055) / 1.055) ** 2.4


@pytest.mark.parametrize("color", [(128, 128, 128), (180, 90, 60), (40, 90, 160)])
def test_a_patch_keeps_its_hue_and_gets_the_metered_brightness(color: tuple[int, int, int]) -> None:
    mean = formed(patch(color), metered=0.2).mean(axis=(0, 1))
    light = np.array([linear(each) for each in mean])
    assert light @ [0.2126, 0.7152, 0.0722] == pytest.approx(0.2, rel=0.03)
    if len(set(color)) == 1:
        assert np.ptp(mean) <= 1.0
    else:
        assert np.argsort(mean).tolist() == np.argsort(color).tolist()


def test_what_is_far_brighter_than_the_mean_is_clipped() -> None:
    image = patch((60, 60, 60))
    image[:16] = 250
    result = formed(image, metered=0.35)
    assert (result[:14] >= 254.0).all()
    assert result[20:].max() < 200.0


def test_what_lies_outside_the_image_circle_is_not_metered() -> None:
    image, imager = patch((120, 120, 120)), Imager.model_validate(CLEAN)
    falloff = np.ones((*image.shape[:2], 3), np.float32)
    whole = develop(expose(image, imager, 1, falloff), imager)
    falloff[:, 48:] = 0.0
    half = develop(expose(image, imager, 1, falloff), imager)
    assert np.abs(half[:, :40].astype(int) - whole[:, :40]).max() <= 1
    assert half[:, 56:].max() == 0


@pytest.mark.parametrize("sigma_px", [0.6, 1.2])
def test_an_edge_is_as_wide_as_the_point_spread(sigma_px: float) -> None:
    image = patch((90, 90, 90), (64, 128))
    image[:, 64:] = 110
    lines = np.vectorize(linear)(formed(image, metered=0.2, blur_px=sigma_px)[24:40].mean(axis=(0, 2)))
    share = np.gradient((lines - lines[40]) / (lines[-40] - lines[40]))[48:80]
    place = np.arange(48, 80)
    middle = np.sum(share * place)
    width = np.sqrt(np.sum(share * (place - middle) ** 2))
    assert middle == pytest.approx(63.5, abs=0.3)
    assert width == pytest.approx(np.sqrt(sigma_px**2 + 0.5), abs=0.25)  # np.gradient itself has a variance of 0.5


def test_noise_is_that_of_the_electrons() -> None:
    """Of 1,000 electrons at white, 200 have shot noise of sqrt(200), read noise of 5; interpolation averages some."""
    noisy = formed(patch((120, 120, 120), (200, 200)), full_well_electrons=1000, read_sigma_electrons=5.0, metered=0.2)
    expected = np.sqrt(200.0 + 25.0) / 1000.0
    slope = 255.0 * (1.055 / 2.4) * 0.2 ** (1.0 / 2.4 - 1.0)
    assert noisy[..., 1].std() == pytest.approx(expected * slope, rel=0.35)
    again = formed(patch((120, 120, 120), (200, 200)), full_well_electrons=1000, read_sigma_electrons=5.0, metered=0.2)
    other = formed(patch((120, 120, 120), (200, 200)), 2, full_well_electrons=1000, read_sigma_electrons=5.0)
    assert np.array_equal(noisy, again)
    assert not np.array_equal(noisy, other)


def test_scattered_light_lifts_shadows() -> None:
    image = patch((2, 2, 2), (128, 128))
    image[:, 64:] = 120
    dark, lifted = formed(image, glare=0.0, metered=0.1), formed(image, glare=0.1, metered=0.1)
    assert lifted[:, 48:56].mean() > dark[:, 48:56].mean() + 3.0


def test_red_lies_outside_blue_in_the_corners() -> None:
    image = patch((30, 30, 30), (200, 200))
    image[150:156, 150:156] = 200
    lines = formed(image, lateral_color_px=3.0, metered=0.05)[:, 140:165].mean(axis=1)
    lines = np.maximum(lines - lines[:100].max(axis=0), 0.0)
    red, green, blue = (np.arange(200) @ lines / lines.sum(axis=0)).tolist()
    assert red > green + 0.5 > blue + 1.0


def test_balance_saturation_contrast_and_sharpening_do_what_they_say() -> None:
    gray = patch((100, 100, 100))
    warm = formed(gray, white_balance=(1.2, 0.8)).mean(axis=(0, 1))
    assert warm[0] > warm[1] > warm[2]
    color = patch((140, 100, 80))
    assert np.ptp(formed(color, saturation=0.0).mean(axis=(0, 1))) < 1.5
    assert np.ptp(formed(color, saturation=1.5).mean(axis=(0, 1))) > np.ptp(formed(color).mean(axis=(0, 1)))
    assert formed(gray, metered=0.05, contrast=1.0).mean() < formed(gray, metered=0.05).mean()
    edge = patch((90, 90, 90))
    edge[:, 48:] = 110
    assert formed(edge, sharpening=1.0).max() > formed(edge).max() + 2.0


def test_a_camera_has_either_noise_or_an_imager() -> None:
    with pytest.raises(ValueError, match="noise and imager are set"):
        Optics.model_validate({"noise": {}, "imager": {}})
    with pytest.raises(ValueError, match="white_balance"):
        Imager.model_validate({"white_balance": (0.0, 1.0)})
