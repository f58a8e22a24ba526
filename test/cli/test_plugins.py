"""Verbs and exporters of other distributions: the pages on them are followed, and clashes and faults are one line."""

import re
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fake_distribution import announce
from made_up_scene import made_up_scene, record_made_up
from several_agents import made_up_agents

ROOT = Path(__file__).parents[2]
FILES = re.compile(r"`([\w/.]+)` <!-- new file -->.*?^```(?:python|toml)\n(.*?)^```", re.M | re.S)
Simbev = Callable[..., tuple[int, str, str]]


def follow(page: str, folder: Path) -> None:
    """Write the new files of a page on extending."""
    text = (ROOT / "docs/extending" / page).read_text(encoding="utf-8")
    for name, content in FILES.findall(text):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(content, encoding="utf-8")


def write_project(folder: Path, name: str, group: str, **entries: str) -> Path:
    """A distribution without modules, which announces entry points."""
    folder.mkdir()
    lines = [f'{entry} = "{at}"' for entry, at in entries.items()]
    text = "\n".join(["[project]", f'name = "{name}"', 'version = "1"', f'[project.entry-points."{group}"]', *lines])
    (folder / "pyproject.toml").write_text(text)
    return folder


@pytest.fixture
def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    """Undo imports of the pages' modules."""
    for name in ("simbev_distance", "simbev_clouds"):
        monkeypatch.setitem(sys.modules, name, None)
        del sys.modules[name]


@pytest.mark.usefixtures("forget")
def test_the_page_on_verbs_is_right(simbev: Simbev, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    record_made_up(tmp_path / "set/scenes/test/Blocks-0002", made_up_agents())
    follow("verb.md", tmp_path)
    announce(tmp_path / "distance", tmp_path / "site", monkeypatch)
    code, out, _ = simbev("distance", tmp_path / "set", "--unit", "km")
    assert code == 0 and re.fullmatch(r"Blocks-0002: \d+\.\d km\n", out)
    assert simbev("distance", tmp_path, "--unit", "mile")[::2] == (2, "error: --unit: is 'mile'; allowed: m, km\n")
    assert re.search("distance +Print how far the ego vehicle", simbev("--help")[1])


@pytest.mark.usefixtures("forget")
def test_the_page_on_exports_is_right(simbev: Simbev, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made_up_scene(tmp_path / "set/scenes/train/Blocks-0000", ticks=2)
    follow("export.md", tmp_path)
    announce(tmp_path / "clouds", tmp_path / "site", monkeypatch)
    call = ("export", "clouds", tmp_path / "set", "--out", tmp_path / "out", "--workers", 1)
    assert simbev(*call)[:2] == (0, f"2 frames of 1 scenes in {tmp_path / 'out'}\n")
    assert simbev(*call)[1].endswith("1 scenes were there already\n")
    assert re.search("clouds +Write the lidar clouds", simbev("export", "--help")[1])
    page_test: dict[str, Callable[[Path], None]] = {}
    exec((tmp_path / "clouds/test_clouds_export.py").read_text(), page_test)
    page_test["test_clouds_come_out_as_they_went_in"](tmp_path / "again")
    assert np.fromfile(tmp_path / "out/Blocks-0000/velodyne/000000.bin", np.float32).size


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["run"], "simbev.verbs: 'run' of pack0 is simbev_ros's already; uninstall one"),
        (["drift", "drift"], "simbev.verbs: 'drift' of pack1 is pack0's already; uninstall one"),
    ],
)
def test_a_name_that_is_taken_is_refused(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, names: list[str], message: str
) -> None:
    for number, name in enumerate(names):
        project = write_project(tmp_path / f"{number}", f"pack{number}", "simbev.verbs", **{name: f"module{number}:f"})
        announce(project, project / "site", monkeypatch)
    assert refused("--help") == f"error: {message}\n"


def test_a_distribution_that_cannot_be_imported_says_so_and_leaves_the_others_alone(
    simbev: Simbev, refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for group in ("verbs", "exporters"):
        project = write_project(tmp_path / group, f"of_{group}", f"simbev.{group}", broken="no_such_module:f")
        announce(project, project / "site", monkeypatch)
    assert "broken of of_verbs cannot be imported" in simbev("--help")[1]
    assert refused("broken") == "error: broken of of_verbs cannot be imported: No module named 'no_such_module'\n"
    assert "of_exporters cannot be imported" in refused("export", "broken")


@pytest.mark.parametrize(
    ("words", "distribution", "target"),
    [
        ("train", "simbev_training", "'./training[torch]'"),
        ("predict", "simbev_training", "./training"),
        ("export coco", "simbev_exporters", "./exporters"),
        ("export nuscenes", "simbev_exporters", "./exporters"),
    ],
)
def test_commands_of_the_repositorys_other_distributions_say_how_to_get_them(
    refused: Callable[..., str], monkeypatch: pytest.MonkeyPatch, words: str, distribution: str, target: str
) -> None:
    monkeypatch.setattr("simbev_ros.cli.plugins.entry_points", lambda group: ())
    remedy = f"install it in the repository: {sys.executable} -m pip install {target}"
    assert refused(*words.split(), "set") == f"error: simbev {words} belongs to {distribution}; {remedy}\n"
