"""The pages in a real browser, opened from the disk: filters, sorting, charts and the video work without an error."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import evaluated_dataset as made
import pytest
from made_up_scene import made_up_scene
from typer.testing import CliRunner

from simbev_ros.cli.main import app
from simbev_ros.evaluation.predictions.dataset_predictions import write_predictions

pytest.importorskip("selenium", reason="selenium is not installed: pip install -e .[test]")

from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select, WebDriverWait

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None or DRIVER is None, reason="chromium and chromedriver are not installed"),
]
OPTIONS = ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--window-size=1400,1000", "--no-first-run")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The pages of a dataset of three scenes."""
    folder = tmp_path_factory.mktemp("browsed")
    for number, split in enumerate(("train", "val", "train")):
        made_up_scene(folder / f"set/scenes/{split}/Blocks-{number:04d}", number=number, split=split, ticks=8)
    result = CliRunner().invoke(app, ["info", str(folder / "set"), "--report", str(folder / "report")])
    assert result.exit_code == 0, result.output
    return folder / "report"


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Any]:
    """Headless Chromium, whose console must stay empty and which fetches nothing but files."""
    options = webdriver.ChromeOptions()
    options.binary_location = str(CHROMIUM)
    for option in (*OPTIONS, f"--user-data-dir={tmp_path / 'profile'}"):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(str(DRIVER)))
    try:
        yield driver
        assert driver.get_log("browser") == []
        fetched = driver.execute_script("return performance.getEntriesByType('resource').map((entry) => entry.name)")
        assert [address for address in fetched if not address.startswith(("file:", "data:"))] == []
    finally:
        driver.quit()


def shown(browser: Any) -> list[str]:
    """Names of the scenes in the table that are shown, from the top."""
    rows = browser.find_elements(By.CSS_SELECTOR, "table.browse tbody tr")
    return [row.find_element(By.CSS_SELECTOR, 'td[data-label="scene"]').text for row in rows if row.is_displayed()]


def test_filters_filter_and_are_kept_in_the_address(browser: Any, report: Path) -> None:
    browser.get((report / "index.html").as_uri())
    assert shown(browser) == ["Blocks-0000", "Blocks-0001", "Blocks-0002"]
    Select(browser.find_element(By.XPATH, "//label[starts-with(., 'split')]/select")).select_by_value("train")
    assert shown(browser) == ["Blocks-0000", "Blocks-0002"]
    browser.find_element(By.CSS_SELECTOR, 'input[aria-label="vehicles, minimum"]').send_keys("4")
    assert shown(browser) == ["Blocks-0002"]
    assert browser.find_element(By.ID, "shown").text == "1 of 3 scenes"
    browser.refresh()
    assert shown(browser) == ["Blocks-0002"]
    browser.find_element(By.CSS_SELECTOR, "button[type=reset]").click()
    WebDriverWait(browser, 10).until(lambda driver: len(shown(driver)) == 3)


def test_columns_sort_by_keyboard_in_both_directions(browser: Any, report: Path) -> None:
    browser.get((report / "index.html").as_uri())
    head = browser.find_element(By.XPATH, "//th[button[text()='sun °']]")
    orders = []
    for _ in range(2):
        head.find_element(By.TAG_NAME, "button").send_keys(Keys.ENTER)
        orders.append((head.get_attribute("aria-sort"), shown(browser)))
    names = ["Blocks-0000", "Blocks-0001", "Blocks-0002"]
    assert orders == [("ascending", names), ("descending", names[::-1])]


def test_charts_are_drawn_when_they_come_into_view(browser: Any, report: Path) -> None:
    browser.get((report / "index.html").as_uri())
    charts = browser.find_elements(By.CSS_SELECTOR, ".chart")
    assert len(charts) > 50 and not charts[-1].find_elements(By.CSS_SELECTOR, ".main-svg")
    for chart in (charts[len(charts) // 2], charts[-1]):
        browser.execute_script("arguments[0].scrollIntoView()", chart)
        WebDriverWait(browser, 20).until(lambda _, chart=chart: chart.find_elements(By.CSS_SELECTOR, ".main-svg"))


def test_an_evaluations_report_draws_its_charts_without_other_files(browser: Any, tmp_path: Path) -> None:
    predictions, dataset = tmp_path / "predictions", made.record(tmp_path / "set")
    predictions.mkdir()
    write_predictions(predictions / "boxes.parquet", [(made.NAMES[0], made.as_predicted())])
    command = ["evaluate", str(predictions), str(dataset), "--report", str(tmp_path / "report.html")]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0, result.output
    browser.get((tmp_path / "report.html").as_uri())
    assert len(browser.find_elements(By.CSS_SELECTOR, ".chart")) > 2
    WebDriverWait(browser, 20).until(lambda driver: driver.find_elements(By.CSS_SELECTOR, ".scatterlayer .trace"))


def test_a_scene_is_reached_by_its_link_and_its_video_moves_the_dot_on_the_map(browser: Any, report: Path) -> None:
    browser.get((report / "index.html").as_uri())
    browser.find_element(By.LINK_TEXT, "Blocks-0001").click()
    assert browser.find_element(By.TAG_NAME, "h1").text == "Blocks-0001"
    plots = WebDriverWait(browser, 20).until(lambda driver: driver.find_elements(By.CSS_SELECTOR, ".plot .main-svg"))
    assert plots
    script = "return document.querySelector('[data-clock=path] .plot').data.at(-1).x[0]"
    start_m = browser.execute_script(script)
    browser.execute_script("const video = document.querySelector('video'); video.preload = 'auto'; video.load()")
    WebDriverWait(browser, 20).until(
        lambda driver: driver.execute_script("return document.querySelector('video').readyState") > 0
    )
    browser.execute_script("document.querySelector('video').currentTime = 0.2")
    WebDriverWait(browser, 20).until(lambda driver: driver.execute_script(script) > start_m)
    pictures = browser.execute_script("return [...document.images].map((image) => image.naturalWidth)")
    assert all(pictures)
