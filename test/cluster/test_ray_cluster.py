"""Connections to Ray clusters: bad addresses are refused at once, and so are nodes that would make other bytes."""

import importlib.util
import re
import socket
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fake_ray import FakeRay, GetTimeoutError, RayError, install_fake_ray

from simbev_ros import __version__
from simbev_ros.cluster import ray_cluster
from simbev_ros.cluster.ray_cluster import RayCluster
from simbev_ros.errors import InputError
from simbev_ros.production import make_dataset

CODE = {"python": b"3.12", "module simbev_ros.world": b"a", "library numpy": b"2.1.0"}
AUTO = "auto"


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster of two nodes that run the same code as this machine."""
    monkeypatch.setattr(ray_cluster, "_code", lambda modules: CODE)
    fake = install_fake_ray(monkeypatch)
    for name in ("aaaaaaaa", "bbbbbbbb"):
        fake.add_node(name)
        fake.answers["_sweep_node", name] = None
    return fake


@pytest.fixture
def closed_address() -> Iterator[str]:
    """An address on this machine at which nothing listens."""
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        yield f"127.0.0.1:{reserved.getsockname()[1]}"


def report(**changes: Any) -> Any:
    """What a node says about itself."""
    return ray_cluster._NodeReport(**{"version": __version__, "code": CODE, "problem": None, **changes})


def refusal_of_nodes(*folders: Path) -> str:
    """Message with which nodes are refused."""
    with RayCluster(AUTO) as cluster, pytest.raises(InputError) as refused:
        cluster.check_nodes(*folders)
    assert "\n" not in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize(
    "address", ["x", "10.0.0.5", ":1", "http://a:1", "ray://a:1", "a:0", "a:65536", "a:٣", "a:", "", "a:1" + "0" * 5000]
)
def test_an_address_of_another_form_is_refused(ray: FakeRay, address: str) -> None:
    with pytest.raises(InputError) as refused:
        RayCluster(address)
    allowed = "allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379"
    assert str(refused.value) == f"--ray: is {address!r:.80}; {allowed}"
    assert not ray.is_open


def test_an_address_at_which_nothing_listens_is_refused_at_once(ray: FakeRay, closed_address: str) -> None:
    began_s = time.monotonic()
    answer = rf"^--ray {closed_address}: nothing answers at {closed_address}: Connection refused$"
    with pytest.raises(InputError, match=answer):
        RayCluster(closed_address)
    assert time.monotonic() - began_s < 2.0 and not ray.is_open


def test_a_cluster_of_another_address_is_connected_to(ray: FakeRay) -> None:
    with socket.create_server(("127.0.0.1", 0)) as head:
        address = f"127.0.0.1:{head.getsockname()[1]}"
        with RayCluster(address) as cluster:
            assert ray.is_open and cluster.address == address
    assert not ray.is_open


def test_without_ray_the_message_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    real = importlib.util.find_spec
    monkeypatch.setattr(ray_cluster, "find_spec", lambda name: None if name == "ray" else real(name))
    with pytest.raises(InputError, match=r"^--ray needs Ray; install it: \S+ -m pip install 'ray\[default\]'$"):
        RayCluster(AUTO)


def test_auto_without_a_cluster_says_what_to_do(ray: FakeRay, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.delenv("RAY_ADDRESS")
    monkeypatch.setenv("RAY_TMPDIR", str(tmp_path))
    with pytest.raises(InputError) as refused:
        RayCluster(AUTO)
    assert str(refused.value).startswith("--ray auto: this machine is no node of a Ray cluster; start one with ray ")
    assert "\n" not in str(refused.value)


def test_another_version_of_ray_or_python_is_refused_in_one_line(ray: FakeRay) -> None:
    ray.refusal = RuntimeError("Version mismatch:\n    Ray: 2.1.0\n    Python: 3.11\n\nMore advice.\n")
    with pytest.raises(InputError, match=r"^--ray auto: Version mismatch: Ray: 2\.1\.0 Python: 3\.11$"):
        RayCluster(AUTO)


@pytest.mark.parametrize("address", ["x", "auto"])
def test_nothing_is_written_when_the_cluster_cannot_be_used(ray: FakeRay, tmp_path: Path, address: str) -> None:
    ray.refusal = ConnectionError()
    with pytest.raises(InputError, match=r"^--ray"):
        make_dataset("demo", tmp_path / "set", ray=address)
    assert not (tmp_path / "set").exists()


def test_workers_beside_a_cluster_are_refused(ray: FakeRay, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"is for this machine alone; a cluster has as many as there is room for"):
        make_dataset("demo", tmp_path / "set", workers=2, ray=AUTO)
    assert not ray.is_open and not (tmp_path / "set").exists()


def test_nodes_with_the_same_code_that_see_the_folder_are_accepted(ray: FakeRay, tmp_path: Path) -> None:
    (second := tmp_path / "second").mkdir()
    with RayCluster(AUTO) as cluster:
        cluster.check_nodes(tmp_path, second)
        cluster.check_nodes()
    assert list(tmp_path.rglob("*")) == [second]


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": "0.0.9"}, f"has simbev_ros 0.0.9, this machine {__version__}"),
        ({"code": {**CODE, "module simbev_ros.world": b"b"}}, "module simbev_ros.world differs; all nodes need the"),
        ({"code": {**CODE, "module simbev_ros.x": b"b"}}, "module simbev_ros.x is not here; all nodes need the"),
        ({"code": {"python": b"3.12", "library numpy": b"2.1.0"}}, "module simbev_ros.world is not there; all nodes"),
        ({"code": {**CODE, "library numpy": b"1.26.4"}}, "has library numpy 1.26.4, this machine 2.1.0; all nodes"),
        ({"code": {**CODE, "library scipy": b"1.0"}}, "has library scipy 1.0, this machine not at all; all nodes"),
        ({"code": {**CODE, "python": b"3.11"}}, "has python 3.11, this machine 3.12; all nodes need the same code"),
        ({"problem": "cannot write to /data"}, "cannot write to /data"),
    ],
)
def test_a_node_that_differs_is_named_with_the_difference(ray: FakeRay, changes: dict[str, Any], message: str) -> None:
    ray.answers["_describe_node", "bbbbbbbb"] = report(**changes)
    assert refusal_of_nodes().startswith(f"node bbbbbb at 10.0.0.2: {message}")


def test_a_node_that_does_not_answer_is_named(ray: FakeRay) -> None:
    ray.answers["_describe_node", "aaaaaaaa"] = GetTimeoutError()
    assert refusal_of_nodes() == "node aaaaaa at 10.0.0.1: has not answered within 120 s"


def test_a_node_without_this_package_is_named_with_the_error(ray: FakeRay) -> None:
    ray.answers["_describe_node", "aaaaaaaa"] = RayError("No module named\n  'simbev_ros'\n\nTraceback")
    expected = "node aaaaaa at 10.0.0.1: cannot run this package: No module named 'simbev_ros'"
    assert refusal_of_nodes() == expected


def test_nodes_without_cpus_and_dead_ones_are_not_asked(ray: FakeRay) -> None:
    ray.listed[0]["Resources"].pop("CPU")
    ray.listed[1]["Alive"] = False
    for name in ("aaaaaaaa", "bbbbbbbb"):
        ray.answers["_describe_node", name] = GetTimeoutError()
    with RayCluster(AUTO) as cluster:
        cluster.check_nodes()


def test_a_node_that_does_not_see_the_folder_is_refused(tmp_path: Path) -> None:
    problem = ray_cluster._folder_problem(tmp_path / "set" / ".probe")
    assert problem == f"does not see the folder {tmp_path}/set; --out must be a folder that all nodes see"


def test_a_node_that_cannot_write_to_the_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".probe").touch()
    assert ray_cluster._folder_problem(tmp_path / ".probe") is None
    monkeypatch.setattr(ray_cluster.os, "access", lambda path, mode: False)
    assert ray_cluster._folder_problem(tmp_path / ".probe") == f"cannot write to {tmp_path}"


def test_the_probe_is_removed_when_a_node_is_refused(ray: FakeRay, tmp_path: Path) -> None:
    ray.answers["_describe_node", "bbbbbbbb"] = report(problem="cannot write")
    assert re.fullmatch(r"node bbbbbb at 10\.0\.0\.2: cannot write", refusal_of_nodes(tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_still_to_be_made_is_checked_where_it_will_be(ray: FakeRay, tmp_path: Path) -> None:
    ray.answers["_describe_node", "bbbbbbbb"] = report(problem="cannot write")
    assert refusal_of_nodes(tmp_path / "new/export") == "node bbbbbb at 10.0.0.2: cannot write"
    assert list(tmp_path.iterdir()) == []


def test_nodes_that_read_the_same_dataset_are_accepted(ray: FakeRay, tmp_path: Path) -> None:
    bag = tmp_path / "set/scenes/train/Blocks-0000/Blocks-0000_0.mcap"
    bag.parent.mkdir(parents=True)
    bag.write_bytes(b"bag")
    with RayCluster(AUTO) as cluster:
        cluster.check_nodes(reads=[tmp_path / "set", bag.parent, bag])
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [bag]


@pytest.mark.parametrize("change", [lambda bag: bag.unlink(), lambda bag: bag.write_bytes(b"another bag")])
def test_a_node_that_does_not_see_the_bags_as_they_are_here_is_refused(
    tmp_path: Path, change: Callable[[Path], object]
) -> None:
    bag = tmp_path / "bag.mcap"
    bag.write_bytes(b"bag")
    sample = ray_cluster._Sample.of(tmp_path)
    assert sample.problem() is None
    change(bag)
    assert sample.problem() == f"does not see {tmp_path} as this machine does; all nodes must see it"


def test_the_code_of_the_modules_that_do_the_work_is_compared() -> None:
    known = ray_cluster._code.__wrapped__(("simbev_ros.recording.verify",))
    assert "module simbev_ros.recording.verify" in known and "module simbev_ros.production.scene_maker" not in known
