"""What ``./simbev`` installs is found by scripts anywhere, even beside a checkout, whose folder has the same name."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[3]


@pytest.mark.parametrize("module", ["simbev_ros.config.scenario", "simbev_exporters.opv2v.export"])
def test_a_script_beside_the_checkout_imports_the_package(module: str, tmp_path: Path) -> None:
    for folder in ("simbev_ros", "simbev_exporters"):
        (tmp_path / folder).symlink_to(REPOSITORY if folder == "simbev_ros" else REPOSITORY / "exporters")
    script = tmp_path / "script.py"
    script.write_text(f"import {module}\n", encoding="utf-8")
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTHON")}
    subprocess.run([sys.executable, script], check=True, env=environment)
