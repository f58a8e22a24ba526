"""A recorded scene in headless Chromium: cameras and 3D view show it, it plays, and no other host is asked."""

import shutil
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from view_process import running_viewer

from simbev_ros.foundation.types import UInt8Array

pytest.importorskip("rerun", reason="Rerun is not installed: pip install -e .[view]")
pytest.importorskip("selenium", reason="selenium is not installed: pip install -e .[test]")

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.support.ui import WebDriverWait

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="chromium and chromedriver are not installed"),
]
OPTIONS = (
    *("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1280,645", "--no-first-run"),
    *("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"),
)
BACKGROUND = (22, 24, 28)
"""Color of the views where nothing is."""
FONTS = "fonts.googleapis.com"
TIMEOUT_S = 90
ENTRIES = """
const kinds = ["navigation", "resource"];
const entries = kinds.flatMap((kind) => performance.getEntriesByType(kind));
return entries.map((entry) => [entry.name, entry.responseStatus, entry.transferSize]);
"""


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


def screenshot(browser: Any) -> UInt8Array:
    """(H, W, 3) picture of the page."""
    return np.asarray(Image.open(BytesIO(browser.get_screenshot_as_png())).convert("RGB"))


def camera_rows(picture: UInt8Array) -> list[UInt8Array]:
    """The row of pixels through the middle of each view on the left that has nothing at its left border."""
    is_empty = (picture[:, 5] == BACKGROUND).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], is_empty, [False]])))
    return [picture[(start + end) // 2] for start, end in edges.reshape(-1, 2).tolist() if end - start > 10]


def shows_ramp(row: UInt8Array) -> bool:
    """Whether a row of pixels holds the gray ramp of the made-up images, which grows brighter to the right."""
    pixels = row[: len(row) // 2].astype(int)
    ramp = pixels[(pixels != BACKGROUND).any(axis=1)][1:-1]  # the outermost ones are blended with the background
    if len(ramp) < 20 or np.ptp(ramp, axis=1).max() > 6:
        return False
    levels = ramp.mean(axis=1)
    return bool(np.diff(levels).min() > -6 and levels[0] < 30 and levels[-1] > 220)


def world_view(picture: UInt8Array) -> UInt8Array:
    """The 3D view, without its borders."""
    height_px, width_px, _ = picture.shape
    return picture[round(0.15 * height_px) : round(0.58 * height_px), round(0.61 * width_px) : round(0.99 * width_px)]


def shows_boxes(view: UInt8Array) -> bool:
    """Whether a view holds things of many colors before the background."""
    pixels = view.reshape(-1, 3)
    vivid = pixels[np.ptp(pixels, axis=1) > 60]
    is_empty = (pixels == BACKGROUND).all(axis=1)
    return bool(len(vivid) > 300 and len(np.unique(vivid // 32, axis=0)) > 15 and 0.2 < is_empty.mean() < 0.99)


def test_a_recorded_scene_is_shown_and_plays_without_any_other_host(browser: Any, tmp_path: Path) -> None:
    with running_viewer(tmp_path, "--no-open", ticks=60) as viewer:
        assert urlsplit(viewer.url).query.startswith("token="), "the printed address is enough"
        browser.get(viewer.url)
        views: set[bytes] = set()

        def is_shown(_: Any) -> bool:
            picture = screenshot(browser)
            Image.fromarray(picture).save(tmp_path / "picture.png")
            cameras, world = camera_rows(picture)[:2], world_view(picture)
            if shows_boxes(world):
                views.add(world.tobytes())
            return len(cameras) == 2 and all(map(shows_ramp, cameras)) and len(views) > 3

        WebDriverWait(browser, TIMEOUT_S).until(is_shown)
        entries = {name: (status, size) for name, status, size in browser.execute_script(ENTRIES)}
    foreign = {name: answer for name, answer in entries.items() if urlsplit(name).hostname != "127.0.0.1"}
    assert {urlsplit(name).hostname for name in foreign} <= {FONTS}
    assert all(answer == (0, 0) for answer in foreign.values()), "the policy has refused it"
    assert any(name.endswith(".wasm") and status == 200 for name, (status, _) in entries.items())
