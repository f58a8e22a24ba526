"""The option --ray: what it refuses before anything is written."""

import socket
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_ray import install_fake_ray

pytestmark = pytest.mark.usefixtures("no_graph")


@pytest.mark.parametrize("form", [("--ray={}",), ("--ray", "{}")], ids=["joined", "apart"])
@pytest.mark.parametrize("address", ["x", "10.0.0.5", ":1", "http://a:1", "ray://a:1", "[/no]"])
def test_a_bad_address_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, address: str, form: tuple[str, ...]
) -> None:
    install_fake_ray(monkeypatch)
    message = refused("generate", "demo", "--out", tmp_path / "set", *(part.format(address) for part in form))
    allowed = "allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379"
    assert message == f"error: --ray: is {address!r}; {allowed}\n"
    assert not (tmp_path / "set").exists()


def test_an_address_at_which_nothing_listens_is_refused(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_fake_ray(monkeypatch)
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        address = f"127.0.0.1:{reserved.getsockname()[1]}"
        message = refused("generate", "demo", "--out", tmp_path / "set", "--ray", address)
    assert message == f"error: --ray: {address}: nothing answers at {address}: Connection refused\n"
    assert not (tmp_path / "set").exists()


def test_without_ray_one_line_says_how_to_install_it(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    message = refused("generate", "demo", "--out", tmp_path / "set", "--ray", "auto")
    assert message.startswith("error: a cluster needs Ray; install it: ") and message.endswith("[cluster]'\n")
    assert message.count("\n") == 1 and not (tmp_path / "set").exists()


def test_auto_without_a_cluster_is_refused_in_one_line(
    refused: Callable[..., str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install_fake_ray(monkeypatch)
    monkeypatch.delenv("RAY_ADDRESS")
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    message = refused("generate", "demo", "--out", tmp_path / "set", "--ray", "auto")
    assert message.startswith("error: --ray: auto: this machine is not a node of a Ray cluster; ")
    assert message.count("\n") == 1 and not (tmp_path / "set").exists()


def test_workers_beside_ray_are_refused(refused: Callable[..., str], tmp_path: Path) -> None:
    message = refused("generate", "demo", "--out", tmp_path / "set", "--workers", 2, "--ray", "auto")
    assert message.startswith("error: --workers: is for this machine alone; a cluster ")
    assert not (tmp_path / "set").exists()
