"""A running graph in headless Chromium: the camera's image and the points of the lidar appear."""

import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from commands import Config, Simbev
from PIL import Image
from waiting import wait_until

from simbev_ros.foundation.types import UInt8Array

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
pytest.importorskip("selenium", reason="selenium is not installed: pip install -e .[test]")

from selenium import webdriver
from selenium.webdriver.chrome.service import Service

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.graph,
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="chromium and chromedriver are not installed"),
]
OPTIONS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1100,720", "--no-first-run"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)
BACKGROUND = (22, 24, 28)
"""Color of the views where nothing is."""


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Any]:
    """Headless Chromium, with WebGL in software."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for option in (*OPTIONS, f"--user-data-dir={tmp_path / 'profile'}"):
        options.add_argument(option)
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    try:
        yield driver
    finally:
        driver.quit()


def part(picture: UInt8Array, columns: tuple[float, float], rows: tuple[float, float]) -> UInt8Array:
    """(N, 3) pixels in a rectangle, whose borders are shares of width and height."""
    height_px, width_px, _ = picture.shape
    across, down = (
        slice(*(round(share * size) for share in shares)) for shares, size in ((columns, width_px), (rows, height_px))
    )
    return picture[down, across].reshape(-1, 3)


def shows_camera(picture: UInt8Array) -> bool:
    """Whether the upper left view holds an image: light and dark, of many colors, with nothing of the background."""
    pixels = part(picture, (0.2, 0.34), (0.2, 0.45))
    return bool(
        (pixels != BACKGROUND).any(axis=1).all()
        and np.ptp(pixels.mean(axis=1)) > 60
        and len(np.unique(pixels // 8, axis=0)) > 50
    )


def shows_points(picture: UInt8Array) -> bool:
    """Whether the view on the right holds vividly colored points, of many colors, before the background."""
    pixels = part(picture, (0.62, 0.99), (0.15, 0.58))
    vivid = pixels[np.ptp(pixels, axis=1) > 60]
    is_empty = (np.abs(pixels.astype(int) - BACKGROUND) < 4).all(axis=1)
    return bool(len(vivid) > 500 and len(np.unique(vivid // 32, axis=0)) > 15 and 0.3 < is_empty.mean() < 0.99)


def test_camera_and_lidar_of_a_running_graph_appear(
    browser: Any, simbev: Simbev, small_config: Config, tmp_path: Path
) -> None:
    run = simbev("run", small_config(600), "--record", tmp_path / "out", "--view", "--view-port", 0)
    assert run.process.stdout is not None
    line = next(line for line in run.process.stdout if line.startswith("viewer: http"))
    browser.get(line.removeprefix("viewer: ").strip())
    pictures: list[UInt8Array] = []

    def is_shown() -> bool:
        pictures.append(np.asarray(Image.open(BytesIO(browser.get_screenshot_as_png())).convert("RGB")))
        Image.fromarray(pictures[-1]).save(tmp_path / "picture.png")
        return shows_camera(pictures[-1]) and shows_points(pictures[-1])

    assert not is_shown()
    wait_until(is_shown)
    assert run.process.poll() is None
