"""Extras are known by their modules, and what lacks one says the command that adds it to this very installation."""

import json
import re
import sys
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import extra_of, install_command, load_extras, require_extras

REPOSITORY = Path(__file__).parents[3]
UNINSTALLED = {"rerun": "rerun-sdk"}
"""Modules that set-up does not install, with their distributions."""


class Installed:
    """A stand-in for the distribution, with what pip records of where it came from."""

    def __init__(self, record: dict[str, Any] | None) -> None:
        self.record = record

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return None if self.record is None else json.dumps(self.record)


@pytest.mark.parametrize(
    ("record", "requirement"),
    [
        (None, "'simbev_ros[sim]'"),
        ({"url": "file:///home/me/simbev_ros", "dir_info": {"editable": True}}, "-e '/home/me/simbev_ros[sim]'"),
        ({"url": "file:///my%20files/simbev_ros", "dir_info": {}}, "'/my files/simbev_ros[sim]'"),
        ({"url": "file:///tmp/a-1.0.whl", "archive_info": {}}, "'/tmp/a-1.0.whl[sim]'"),
        ({"url": "https://host/a-1.0.whl", "archive_info": {}}, "'simbev_ros[sim] @ https://host/a-1.0.whl'"),
        (
            {"url": "https://host/me.git", "vcs_info": {"vcs": "git", "commit_id": "1a2b"}},
            "'simbev_ros[sim] @ git+https://host/me.git@1a2b'",
        ),
    ],
)
def test_the_command_installs_from_where_this_installation_came(
    record: dict[str, Any] | None, requirement: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metadata, "distribution", lambda name: Installed(record))
    assert install_command("sim") == f"{sys.executable} -m pip install {requirement}"


def test_what_the_script_has_set_up_it_adds_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SIMBEV_COMMAND", "../my sims/simbev")
    assert install_command("view", "foxglove") == "'../my sims/simbev' setup view,foxglove"


def test_what_runs_from_its_sources_is_installed_from_them(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "distribution", missing)
    assert install_command("view").endswith(f"-m pip install -e '{REPOSITORY}[view]'")


def test_one_missing_module_makes_an_extra_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    sim = load_extras()["sim"]
    sim.require("this")
    monkeypatch.setitem(sys.modules, "osmium", None)
    assert sim.missing == ("osmium",)
    with pytest.raises(InputError, match=r"^this needs the simulator; install it: \S+ -m pip install .*\[sim\]'$"):
        sim.require("this")


def test_an_error_of_importing_is_told_by_its_module() -> None:
    error = ModuleNotFoundError("No module named 'libsumo'", name="libsumo")
    assert extra_of(error) is load_extras()["sim"]
    assert extra_of(ModuleNotFoundError("No module named 'cv2.x'", name="cv2.x")) is load_extras()["pictures"]
    assert extra_of(ModuleNotFoundError("No module named 'nothing'", name="nothing")) is None
    assert extra_of(ImportError("libGL.so.1: cannot open", name="cv2")) is None, "it is installed"


def test_the_table_names_what_the_requirements_bring() -> None:
    text = (REPOSITORY / "setup.py").read_text(encoding="utf-8")
    required = re.findall(r'"([\w\[\]-]+[>=][^";]*)', text)
    names = {canonicalize_name(Requirement(line).name) for line in required} | {"ros-rclpy"}  # of ros-jazzy-rclpy
    homes = metadata.packages_distributions()
    for extra in load_extras().values():
        assert f'"{extra.name}": ' in text
        for module in extra.modules:
            found = homes.get(module, [UNINSTALLED.get(module, module)])
            assert names & {canonicalize_name(name) for name in found}, f"{module} of {extra.name}"


def test_a_verb_that_needs_several_says_one_command(monkeypatch: pytest.MonkeyPatch) -> None:
    for module in ("osmium", "rclpy"):
        monkeypatch.setitem(sys.modules, module, None)
    words = r"^simbev run needs the simulator and ROS 2 Jazzy; install them: \S+ -m pip install .*\[sim,wheels\]'$"
    with pytest.raises(InputError, match=words):
        require_extras(("sim", "wheels"), "simbev run")
