"""Shell scripts, and the commands on pages about other programs, pass shellcheck."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [ROOT / "simbev", ROOT / ".ci/run", ROOT / ".ci/jazzy", *sorted((ROOT / "deploy").rglob("*.sbatch"))]
PAGES = [ROOT / "docs/guide" / f"{name}.md" for name in ("container", "many-machines", "autoware", "nav2")]
BLOCKS = [
    pytest.param(block, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, block in enumerate(re.findall(r"^```sh\n(.*?)^```$", page.read_text(), re.DOTALL | re.MULTILINE))
]
BESIDE_PYTHON = Path(sys.executable).parent / "shellcheck"
SHELLCHECK = str(BESIDE_PYTHON) if BESIDE_PYTHON.exists() else shutil.which("shellcheck")

pytestmark = pytest.mark.skipif(SHELLCHECK is None, reason="shellcheck is not installed")


def complaints(script: str, *options: str) -> str:
    """What shellcheck says about a script."""
    command = [str(SHELLCHECK), "--format=gcc", *options, "-"]
    return subprocess.run(command, input=script, capture_output=True, text=True, check=False).stdout


@pytest.mark.parametrize("script", SCRIPTS, ids=[path.name for path in SCRIPTS])
def test_scripts_pass_shellcheck(script: Path) -> None:
    assert complaints(script.read_text()) == ""


@pytest.mark.parametrize("block", BLOCKS)
def test_printed_commands_pass_shellcheck(block: str) -> None:
    typed = "--exclude=SC2046,SC2164"  # a file of arguments is to be split; who types `cd` sees when it fails
    assert complaints(block, "--shell=bash", typed) == ""


def test_a_mistake_is_found() -> None:
    assert "SC2086" in complaints("#!/bin/sh\nrm $1\n")
