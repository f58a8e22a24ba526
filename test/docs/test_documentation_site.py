"""The documentation builds as a site without a warning."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.skipif(find_spec("material") is None, reason="mkdocs-material is not installed: pip install -e .[docs]")
def test_site_builds_in_strict_mode(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stderr
    assert (tmp_path / "site" / "reference" / "configuration.html").is_file()


def test_tools_are_not_in_the_wheel() -> None:
    text = (ROOT / "setup.py").read_text()
    assert 'find_packages(include=[NAME, f"{NAME}.*"])' in text
