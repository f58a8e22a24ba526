"""The graph of required distributions follows extras and markers as pip does."""

import sys
from importlib import metadata
from pathlib import Path

import pytest

from tools.system_libraries.distributions import DistributionGraph


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of made-up distributions: app → mid → low, app[fast] → quick[more] → deep."""
    install(tmp_path, "app", "Mid_Package>1", 'quick[more]; extra == "fast"', "absent", 'low; python_version < "3"')
    install(tmp_path, "mid-package", "low")
    install(tmp_path, "low")
    install(tmp_path, "quick", 'deep; extra == "more"', 'low; extra == "other"')
    install(tmp_path, "deep", "app")
    monkeypatch.setattr(sys, "path", [str(tmp_path)])
    return tmp_path


def install(site: Path, name: str, *requirements: str) -> None:
    folder = site / f"{name.replace('-', '_')}-1.0.dist-info"
    folder.mkdir()
    lines = [f"Name: {name}", "Version: 1.0", *(f"Requires-Dist: {line}" for line in requirements)]
    (folder / "METADATA").write_text("\n".join(lines))
    (folder / "RECORD").write_text(f"{name}/module.py,,\n{name}/core.so,,\n")


@pytest.mark.usefixtures("site")
def test_without_extras_only_plain_requirements_are_followed() -> None:
    assert set(DistributionGraph("app", []).distributions) == {"app", "mid-package", "low"}


@pytest.mark.usefixtures("site")
def test_extras_of_the_root_and_of_requirements_are_followed() -> None:
    graph = DistributionGraph("app", ["fast"])
    assert set(graph.distributions) == {"app", "mid-package", "low", "quick", "deep"}
    assert graph.required_by("quick") == {"quick", "deep", "app", "mid-package", "low"}
    assert graph.required_by("mid-package") == {"mid-package", "low"}


def test_files_are_found_with_their_distribution(site: Path) -> None:
    files = DistributionGraph("mid-package", []).find_files(lambda file: file.suffix == ".so")
    assert files == {site / "mid-package" / "core.so": "mid-package", site / "low" / "core.so": "low"}


@pytest.mark.usefixtures("site")
def test_a_root_that_is_not_installed_is_refused() -> None:
    with pytest.raises(metadata.PackageNotFoundError, match="nowhere"):
        DistributionGraph("nowhere", [])
