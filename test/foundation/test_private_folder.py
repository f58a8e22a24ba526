"""Users without a home, as in Kubernetes or Slurm, get a folder of their own for caches and logs, or one message."""

import os
import tempfile
from pathlib import Path

import pytest

from simbev_ros.foundation.cache.entries import default_cache_dir
from simbev_ros.foundation.errors import InputError
from simbev_ros.ros.graph.environment import graph_environment


@pytest.fixture(params=["none", "read-only"])
def temporary(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder for temporary files of a user without a home, or with one that cannot be written to."""

    def missing() -> Path:
        raise RuntimeError("Could not determine home directory.")

    home, writable = tmp_path / "home", os.access
    home.mkdir()
    for name in ("XDG_CACHE_HOME", "ROS_LOG_DIR", "ROS_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(Path, "home", missing if request.param == "none" else lambda: home)
    monkeypatch.setattr(
        os, "access", lambda path, mode: home not in (path, *Path(path).parents) and writable(path, mode)
    )
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return tmp_path


def test_caches_and_logs_are_below_a_private_folder(temporary: Path) -> None:
    folder = temporary / f"simbev_ros-home-{os.getuid()}"
    assert default_cache_dir() == folder / ".cache/simbev_ros"
    assert graph_environment(41)["ROS_LOG_DIR"] == str(folder / ".ros/log")
    assert folder.stat().st_mode & 0o777 == 0o700


def test_a_folder_that_others_may_write_to_is_refused(temporary: Path) -> None:
    folder = temporary / f"simbev_ros-home-{os.getuid()}"
    folder.mkdir()
    folder.chmod(0o777)
    with pytest.raises(InputError, match=r"another user owns it or may write to it; set HOME to"):
        default_cache_dir()


def test_a_home_is_used_and_what_the_user_sets(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    assert default_cache_dir() == tmp_path / ".cache/simbev_ros"
    assert "ROS_LOG_DIR" not in graph_environment(41)
    monkeypatch.setenv("XDG_CACHE_HOME", "/elsewhere")
    assert default_cache_dir() == Path("/elsewhere/simbev_ros")
