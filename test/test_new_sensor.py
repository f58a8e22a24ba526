"""docs/extending/sensor.md is followed in a copy of the package; what it says complains, and nothing else does."""

import re
from pathlib import Path

import pytest
from followed_page import FollowedPage

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
ONLY = "barometer or not ["
"""Tests of the new kind, and those that have no parameters."""


@pytest.fixture
def page(tmp_path: Path) -> FollowedPage:
    return FollowedPage("sensor.md", tmp_path)


def mypy_errors(page: FollowedPage, *more: str) -> set[tuple[str, str]]:
    """Errors in all modules where mypy can find that a kind is forgotten, and in some others."""
    paths = sorted((page.copy / "simbev_ros").rglob("*.py"))
    files = {str(path.relative_to(page.copy)) for path in paths if "assert_never" in path.read_text(encoding="utf-8")}
    return page.mypy_errors(*sorted(files | set(more)))


def test_the_page_has_at_most_five_steps_each_in_a_file_of_its_own(page: FollowedPage) -> None:
    assert page.files == re.findall(r"^\| \d \| `([\w/]+\.py)`", page.text, re.MULTILINE)
    assert len(page.files) == len(set(page.files)) <= 5


def test_a_model_that_is_not_in_the_union_is_found(page: FollowedPage) -> None:
    page.follow(1)
    assert page.failures(CHECKS[0], only=ONLY) == page.checks("step 2")


@pytest.mark.slow
def test_what_a_kind_needs_complains_by_itself(page: FollowedPage) -> None:
    page.follow(1, 2)
    (place,) = re.findall(r"`assert_never` in `([\w/.]+)`", page.row("step 4"))
    expected = 'Argument 1 to "assert_never" has incompatible type "Barometer"; expected "Never"'
    assert mypy_errors(page) == {(place, expected)}
    whole = {test for forgotten in BLUNDERS for test in page.checks(forgotten)}  # what checks a kind that has both
    assert page.failures(*CHECKS, only=ONLY) == page.checks("step 4") | page.checks("step 5") | whole


FIRST, *OTHERS = BLUNDERS


@pytest.mark.parametrize("forgotten", [FIRST, *(pytest.param(each, marks=pytest.mark.slow) for each in OTHERS)])
def test_a_node_that_is_at_odds_with_the_manifest_is_found(page: FollowedPage, forgotten: str) -> None:
    page.follow()
    node, (right, wrong) = page.copy / page.files[4], BLUNDERS[forgotten]
    text = node.read_text(encoding="utf-8")
    assert text.count(right) == 1
    node.write_text(text.replace(right, wrong), encoding="utf-8")
    assert page.failures(CHECKS[2], only=ONLY) == page.checks(forgotten)


@pytest.mark.slow
def test_nothing_complains_when_the_page_has_been_followed(page: FollowedPage) -> None:
    page.follow()
    assert mypy_errors(page, *page.files) == set()
    assert page.failures(*CHECKS, only=ONLY) == set()
    page.require_lint()
