"""Connections to Ray clusters: bad addresses are refused at once."""

import socket
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from fake_ray import FakeRay, install_fake_ray

from simbev_ros.foundation.errors import InputError
from simbev_ros.production import make_dataset
from simbev_ros.production.cluster.ray_cluster import RayCluster

AUTO = "auto"


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster of two nodes."""
    fake = install_fake_ray(monkeypatch)
    for name in ("aaaaaaaa", "bbbbbbbb"):
        fake.add_node(name)
        fake.answers["_reap_on_node", name] = None
    return fake


@pytest.fixture
def closed_address() -> Iterator[str]:
    """An address on this machine at which nothing listens."""
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        yield f"127.0.0.1:{reserved.getsockname()[1]}"


@pytest.mark.parametrize(
    "address", ["x", "10.0.0.5", ":1", "http://a:1", "ray://a:1", "a:0", "a:65536", "a:٣", "a:", "", "a:1" + "0" * 5000]
)
def test_an_address_of_another_form_is_refused(ray: FakeRay, address: str) -> None:
    with pytest.raises(InputError) as refused:
        RayCluster(address)
    allowed = "allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379"
    assert str(refused.value) == f"ray: is {address!r:.80}; {allowed}"
    assert not ray.is_open


def test_an_address_at_which_nothing_listens_is_refused(ray: FakeRay, closed_address: str) -> None:
    answer = rf"^ray: {closed_address}: nothing answers at {closed_address}: Connection refused$"
    with pytest.raises(InputError, match=answer):
        RayCluster(closed_address)
    assert not ray.is_open


def test_a_cluster_of_another_address_is_connected_to(ray: FakeRay) -> None:
    with socket.create_server(("127.0.0.1", 0)) as head:
        address = f"127.0.0.1:{head.getsockname()[1]}"
        with RayCluster(address) as cluster:
            assert ray.is_open and cluster.address == address
    assert not ray.is_open


def test_without_ray_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(InputError, match=r"^a cluster needs Ray; install it: \S+ -m pip install .*\[cluster\]'$"):
        RayCluster(AUTO)


def test_auto_without_a_cluster_says_what_to_do(ray: FakeRay, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("RAY_ADDRESS")
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    with pytest.raises(InputError) as refused:
        RayCluster(AUTO)
    assert str(refused.value).startswith("ray: auto: this machine is not a node of a Ray cluster; start one with ray ")
    assert "\n" not in str(refused.value)


def test_another_version_of_ray_or_python_is_refused_in_one_line(ray: FakeRay) -> None:
    ray.refusal = RuntimeError("Version mismatch:\n    Ray: 2.1.0\n    Python: 3.11\n\nMore advice.\n")
    with pytest.raises(InputError, match=r"^ray: auto: Version mismatch: Ray: 2\.1\.0 Python: 3\.11$"):
        RayCluster(AUTO)


@pytest.mark.parametrize("address", ["x", "auto"])
def test_nothing_is_written_when_the_cluster_cannot_be_used(ray: FakeRay, tmp_path: Path, address: str) -> None:
    ray.refusal = ConnectionError()
    with pytest.raises(InputError, match=r"^ray: "):
        make_dataset("demo", tmp_path / "set", ray=address)
    assert not (tmp_path / "set").exists()


def test_workers_beside_a_cluster_are_refused(ray: FakeRay, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is for this machine alone; a cluster has as many as there is room for"):
        make_dataset("demo", tmp_path / "set", workers=2, ray=AUTO)
    assert not ray.is_open and not (tmp_path / "set").exists()
