"""Distributions as ``importlib.metadata`` finds them, which no pip has installed."""

import tomllib
from pathlib import Path

import pytest


def announce(source: Path, site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a distribution importable, and announce its entry points, for one test.

    Args:
        source: Its folder, with ``pyproject.toml`` beside the modules.
        site: A folder for its metadata.
        monkeypatch: Undoes it.
    """
    project = tomllib.loads((source / "pyproject.toml").read_text())["project"]
    info = site / f"{project['name']}-{project['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"]
    lines = [
        line for group in groups for line in (f"[{group}]", *(f"{name} = {at}" for name, at in groups[group].items()))
    ]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")
    for folder in (source, site):
        monkeypatch.syspath_prepend(folder)
