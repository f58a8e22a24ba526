"""The bill of materials that container images hold names what the lock files pin, with version and hashes."""

import json
import os
import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
NEEDED = {"base", "sim", "wheels"}
"""Groups of the lock of which every image has all packages."""


def locked() -> dict[str, tuple[set[str], str, set[str]]]:
    """Name → groups, version and hashes of what the lock pins for this machine."""
    text = (ROOT / "simbev_ros/foundation/installation/requirements.lock").read_text()
    found = {}
    for groups, line, hashes in re.findall(r"^# for (.*)\n(\S.*?) \\\n((?: +--hash.*\n?)+)", text, re.MULTILINE):
        requirement = Requirement(line)
        if requirement.marker is None or requirement.marker.evaluate():
            (specifier,) = requirement.specifier
            contents = set(re.findall(r"sha256:(\w+)", hashes))
            found[canonicalize_name(requirement.name)] = set(groups.split()), specifier.version, contents
    return found


@pytest.mark.slow
@pytest.mark.skipif("ROS_DISTRO" in os.environ, reason="an installed ROS brings packages of its own")
def test_every_locked_package_that_is_installed_is_named_with_version_and_hashes(tmp_path: Path) -> None:
    for name in ("interfaces", "exporters"):
        shutil.copytree(ROOT / name, tmp_path / name)
    for name in ("setup.py", "package.xml", "simbev"):
        shutil.copy(ROOT / name, tmp_path)
    installation = "simbev_ros/foundation/installation"
    shutil.copytree(ROOT / installation, tmp_path / installation)
    python = tmp_path / ".venv/bin/python"
    python.parent.mkdir(parents=True)
    python.write_text(f'#!/bin/sh\nexec "{sys.executable}" "$@"\n')
    python.chmod(0o755)
    hashed = re.search(r"cksum ([^)]*)\)", (ROOT / "simbev").read_text())
    assert hashed is not None
    sums = subprocess.check_output(["sh", "-c", f"cksum {hashed[1]}"], cwd=tmp_path, text=True)
    (tmp_path / ".venv/.ready-sim,wheels").write_text(f"{tmp_path} {sums}")

    bill = json.loads(subprocess.check_output([tmp_path / "simbev", "sbom"]))
    assert bill["bomFormat"] == "CycloneDX" and bill["metadata"]["component"]["name"] == "simbev_ros"
    named = {canonicalize_name(each["name"]): each for each in bill["components"]}
    pinned = locked()
    assert {name for name, (groups, _, _) in pinned.items() if groups & NEEDED} <= set(named)
    for name, (_, version, hashes) in pinned.items():
        if name in named:
            assert named[name]["version"] == version
            (reference,) = named[name]["externalReferences"]
            assert {each["content"] for each in reference["hashes"]} == hashes, name
    installed = {canonicalize_name(each.name): each.version for each in metadata.distributions()}
    assert all(installed[name] == each["version"] for name, each in named.items())
