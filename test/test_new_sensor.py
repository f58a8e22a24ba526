"""docs/extending/sensor.md is followed in a copy of the package; what it says complains, and nothing else does."""

import os
import re
import shutil
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "extending" / "sensor.md").read_text(encoding="utf-8")
STEPS = re.findall(r"^## \d\. [^\n]*`([\w/]+\.py)`\n.*?^```(python|diff)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
CHECKS = [
    "test/config/test_sensor_kinds.py",
    "test/ros/msgs/test_sensor_topics.py",
    "test/ros/nodes/test_sensor_nodes.py",
]


BLUNDERS = {
    "to advertise a topic": ("            self.advertise(topic)\n", ""),
    "to publish on a topic": ("self.publish(topic.name, message)", "del message, topic"),
    "to take a name from the manifest": ("topic.name, message", 'f"/{frame}/pressure", message'),
}
"""Mistakes in the page's node: the text that is right, and the text in its place."""


def row(of: str) -> str:
    """The page's list of checks that complain if something is forgotten."""
    (found,) = re.findall(rf"^\| {of} \| (.*) \|$", PAGE, re.MULTILINE)
    return str(found)


def named(words: str) -> set[str]:
    """The tests that the page names."""
    return set(re.findall(r"test/[\w/]+\.py::\w+", words))


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A folder with a copy of the package that can be changed, and with its tests and settings."""
    shutil.copytree(ROOT / "simbev_ros", tmp_path / "simbev_ros", copy_function=os.symlink)
    for name in ("test", "setup.cfg", "ruff.toml"):
        (tmp_path / name).symlink_to(ROOT / name)
    return tmp_path


def follow(copy: Path, *numbers: int) -> None:
    """Do these steps of the page."""
    for file, kind, text in (STEPS[number - 1] for number in numbers):
        path = copy / file
        changed = text if kind == "python" else patched(path.read_text(encoding="utf-8"), text)
        assert kind == "diff" or not path.exists(), f"{path} is to be new"
        path.unlink(missing_ok=True)
        path.write_text(changed, encoding="utf-8")


def patched(before: str, diff: str) -> str:
    """A text with the changes of a diff, whose parts are each found once."""
    for part in diff.split("@@\n"):
        lines = part.splitlines(keepends=True)
        old, new = ("".join(line[1:] or "\n" for line in lines if line[0] in marks) for marks in (" -\n", " +\n"))
        assert before.count(old) == 1, f"the page's diff does not fit: {old!r}"
        before = before.replace(old, new)
    return before


def run(copy: Path, *words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", *map(str, words)]
    environment = {**os.environ, "PYTHONPATH": str(copy), "PYTHONDONTWRITEBYTECODE": "1"}
    return subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, timeout=300)


def mypy_errors(copy: Path, *more: str) -> set[tuple[str, str]]:
    """File and text of the errors in all modules where mypy can find that a kind is forgotten, and in some others."""
    paths = sorted((copy / "simbev_ros").rglob("*.py"))
    files = {path for path in paths if "assert_never" in path.read_text(encoding="utf-8")}
    files.update(copy / name for name in more)
    with suppress(FileNotFoundError):  # there is none before the package is first checked; mypy takes longer then
        shutil.copytree(ROOT / ".mypy_cache", copy / ".mypy_cache")
    result = run(copy, "mypy", *(file.relative_to(copy) for file in sorted(files)))
    assert result.returncode in (0, 1), result.stdout + result.stderr
    line = r"^(?:.*/)?(simbev_ros/[\w/]+\.py):\d+: error: (.*?)(?:  \[.*)?$"
    return set(re.findall(line, result.stdout, re.MULTILINE))


def failures(copy: Path, *files: str) -> set[str]:
    """The tests of the new kind that fail, without their parameters; and those that have none."""
    options = ("-q", "-p", "no:cacheprovider", "-k", "barometer or not [", "--rootdir", copy)
    result = run(copy, "pytest", *options, *(copy / name for name in files))
    assert result.returncode in (0, 1), result.stdout + result.stderr
    found = re.findall(r"^(?:FAILED|ERROR) (?:.*/)?test/([\w/]+\.py::\w+)", result.stdout, re.MULTILINE)
    return {f"test/{name}" for name in found}


def test_the_page_has_at_most_five_steps_each_in_a_file_of_its_own() -> None:
    files = [file for file, _, _ in STEPS]
    assert files == re.findall(r"^\| \d \| `([\w/]+\.py)`", PAGE, re.MULTILINE)
    assert len(files) == len(set(files)) <= 5


def test_a_model_that_is_not_in_the_union_is_found(copy: Path) -> None:
    follow(copy, 1)
    assert failures(copy, CHECKS[0]) == named(row("step 2"))


def test_what_a_kind_needs_complains_by_itself(copy: Path) -> None:
    follow(copy, 1, 2)
    (place,) = re.findall(r"`assert_never` in `([\w/.]+)`", row("step 4"))
    expected = 'Argument 1 to "assert_never" has incompatible type "Barometer"; expected "Never"'
    assert mypy_errors(copy) == {(place, expected)}
    whole = {test for forgotten in BLUNDERS for test in named(row(forgotten))}  # what checks a kind that has both
    assert failures(copy, *CHECKS) == named(row("step 4")) | named(row("step 5")) | whole


FIRST, *OTHERS = BLUNDERS


@pytest.mark.parametrize("forgotten", [FIRST, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)])
def test_a_node_that_is_at_odds_with_the_manifest_is_found(copy: Path, forgotten: str) -> None:
    follow(copy, 1, 2, 3, 4, 5)
    node, (right, wrong) = copy / STEPS[4][0], BLUNDERS[forgotten]
    text = node.read_text(encoding="utf-8")
    assert text.count(right) == 1
    node.write_text(text.replace(right, wrong), encoding="utf-8")
    assert failures(copy, CHECKS[2]) == named(row(forgotten))


@pytest.mark.slow
def test_nothing_complains_when_the_page_has_been_followed(copy: Path) -> None:
    follow(copy, 1, 2, 3, 4, 5)
    assert mypy_errors(copy, *(file for file, _, _ in STEPS)) == set()
    assert failures(copy, *CHECKS) == set()
    for words in (("check",), ("format", "--check")):
        result = run(copy, "ruff", *words, *(file for file, _, _ in STEPS))
        assert result.returncode == 0, result.stdout + result.stderr
