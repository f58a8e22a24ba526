"""The lock files are those of the present requirements, and nothing in them is without a hash."""

import re
import subprocess
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from tools.lock import BASE, BUILD, FOLDER, OF_KILTED, VARIANTS, WHOLE, _entries, groups, inputs_digest, wanted_groups

ROOT = Path(__file__).parents[2]


@pytest.fixture(params=VARIANTS)
def file(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def text(file: str) -> str:
    return (FOLDER / file).read_text(encoding="utf-8")


def test_it_is_of_the_present_requirements(text: str) -> None:
    assert f"# inputs: {inputs_digest()}\n" in text, "requirements have changed: ./simbev lock"


def test_every_version_has_hashes_and_comes_from_no_address(text: str) -> None:
    entries = [entry for lines in _entries(text).values() for entry in lines]
    assert len(entries) > (50 if "kilted" in text else 150)
    assert all(re.search(r" \\\n    --hash=sha256:[0-9a-f]{64}", entry) for entry in entries)
    assert not re.search(r"https?:|@|--(?:extra-)?index|--find", text)


def test_every_requirement_is_met_in_its_group(file: str, text: str) -> None:
    versions, users = {}, {}
    for group, entry in re.findall(r"^# for (.*)\n(\S+==\S+)", text, re.MULTILINE):
        name, _, version = entry.partition("==")
        versions.setdefault(canonicalize_name(name), []).append(version)
        users[canonicalize_name(name)] = group.split()
    for group, requirements in wanted_groups(file).items():
        for requirement in map(Requirement, requirements):
            name = canonicalize_name(requirement.name)
            assert group in users[name]
            assert all(requirement.specifier.contains(each) for each in versions[name]), requirement


def test_kilted_has_no_package_that_all_releases_share() -> None:
    whole, kilted = (_entries((FOLDER / file).read_text(encoding="utf-8")) for file in (WHOLE, OF_KILTED))
    assert not {"numpy", "pyyaml", "setuptools"} & set(kilted)
    assert {name for name in whole if name.startswith("ros-jazzy")} and not any("jazzy" in name for name in kilted)
    assert kilted["ros-rclpy"] != whole["ros-rclpy"]


@pytest.mark.parametrize("file", [file for file in VARIANTS if file != OF_KILTED])
def test_the_script_takes_the_groups_that_it_needs(text: str, tmp_path: Path) -> None:
    function = re.search(r"^locked\(\) .*?^}", (ROOT / "simbev").read_text(), re.MULTILINE | re.DOTALL)
    assert function is not None
    (tmp_path / "lock").write_text(text)
    script = f'lock={tmp_path}/lock\n{function[0]}\nlocked "{BUILD}"; echo ======; locked "{BASE},pictures"'
    done = subprocess.run(["sh", "-c", script], capture_output=True, text=True, check=True)
    build, chosen = map(_entries, done.stdout.split("======\n"))
    assert sorted(build) == ["pip", "setuptools"]
    assert {"numpy", "opencv-python-headless", "rosbags"} <= set(chosen)
    assert not {"eclipse-sumo", "pytest", "pip", "ray"} & set(chosen)
    assert chosen["numpy"] == _entries(text)["numpy"]


def test_set_up_offers_the_extras_of_both_distributions() -> None:
    listing = re.search(r"^    offered=.*?^    \} \|.*?$", (ROOT / "simbev").read_text(), re.MULTILINE | re.DOTALL)
    assert listing is not None
    script = f'here=$1\n{listing[0]}\nprintf %s "$offered"'
    done = subprocess.run(["sh", "-c", script, "sh", str(ROOT)], capture_output=True, text=True, check=True)
    assert sorted(done.stdout.split()) == sorted(groups().keys() - {BASE, BUILD})
