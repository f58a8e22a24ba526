"""Checks of a cluster's nodes: those that would give other results, or that do not see the same files, are refused."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_ray import FakeRay, GetTimeoutError, RayError, Ref, install_fake_ray

from simbev_ros import __version__
from simbev_ros.foundation.errors import InputError
from simbev_ros.production.cluster import node_check
from simbev_ros.production.cluster.node_check import Code, check_nodes
from simbev_ros.production.cluster.ray_cluster import RayCluster

INPUTS = {"python": b"3.12", "module simbev_ros.simulation.world": b"a", "library numpy": b"2.1.0"}
AUTO = "auto"


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster of two nodes that run the same code as this machine."""
    monkeypatch.setattr(node_check, "_inputs", lambda modules: INPUTS)
    fake = install_fake_ray(monkeypatch)
    for name in ("aaaaaaaa", "bbbbbbbb"):
        fake.add_node(name)
        fake.answers["_reap_on_node", name] = None
    return fake


def refusal_of_nodes(*folders: Path) -> str:
    """Message with which nodes are refused."""
    with RayCluster(AUTO) as cluster, pytest.raises(InputError) as refused:
        check_nodes(cluster, *folders)
    assert "\n" not in str(refused.value)
    return str(refused.value)


def test_nodes_with_the_same_code_that_see_the_folder_are_accepted(ray: FakeRay, tmp_path: Path) -> None:
    (second := tmp_path / "second").mkdir()
    with RayCluster(AUTO) as cluster:
        check_nodes(cluster, tmp_path, second)
        check_nodes(cluster)
    assert list(tmp_path.rglob("*")) == [second]


@pytest.mark.parametrize(
    ("version", "changes", "message"),
    [
        ("0.0.9", {}, f"has simbev_ros 0.0.9, this machine {__version__}"),
        (
            __version__,
            {"module simbev_ros.simulation.world": b"b"},
            "module simbev_ros.simulation.world differs; all nodes need the same code",
        ),
        (__version__, {"module simbev_ros.x": b"b"}, "module simbev_ros.x is not here; all nodes need the same code"),
        (
            __version__,
            {"module simbev_ros.simulation.world": None},
            "module simbev_ros.simulation.world is not there; all nodes need the ",
        ),
        (__version__, {"library numpy": b"1.26.4"}, "has library numpy 1.26.4, this machine 2.1.0; all nodes need "),
        (__version__, {"library scipy": b"1.0"}, "has library scipy 1.0, this machine not at all; all nodes need "),
        (__version__, {"python": b"3.11"}, "has python 3.11, this machine 3.12; all nodes need the same code"),
    ],
)
def test_the_first_difference_in_the_code_is_named(
    version: str, changes: dict[str, bytes | None], message: str
) -> None:
    inputs = {name: value for name, value in {**INPUTS, **changes}.items() if value is not None}
    assert (Code(version, inputs).difference(Code(__version__, INPUTS)) or "").startswith(message)
    assert Code(version, inputs).difference(Code(version, inputs)) is None


def test_a_node_with_a_problem_is_named(ray: FakeRay) -> None:
    ray.answers["node_problem", "bbbbbbbb"] = "cannot write to /data"
    assert refusal_of_nodes() == "node bbbbbb at 10.0.0.2: cannot write to /data"


def test_a_node_that_is_lost_while_it_is_asked_is_left_out(ray: FakeRay, monkeypatch: pytest.MonkeyPatch) -> None:
    ray.answers["node_problem", "aaaaaaaa"] = RayError("The node does not exist any more")
    expected = "node aaaaaa at 10.0.0.1: cannot run this package: The node does not exist any more"
    assert refusal_of_nodes() == expected

    def get(answer: Ref, timeout: float) -> object:
        ray.listed[0]["Alive"] = False
        return answer.get()

    monkeypatch.setattr(ray, "get", get)
    with RayCluster(AUTO) as cluster:
        check_nodes(cluster)


def test_a_node_that_does_not_answer_is_named(ray: FakeRay) -> None:
    ray.answers["node_problem", "aaaaaaaa"] = GetTimeoutError()
    assert refusal_of_nodes() == "node aaaaaa at 10.0.0.1: has not answered within 120 s"


def test_a_node_without_this_package_is_named_with_the_error(ray: FakeRay) -> None:
    ray.answers["node_problem", "aaaaaaaa"] = RayError("No module named\n  'simbev_ros'\n\nTraceback")
    expected = "node aaaaaa at 10.0.0.1: cannot run this package: No module named 'simbev_ros'"
    assert refusal_of_nodes() == expected


def test_nodes_without_cpus_and_dead_ones_are_not_asked(ray: FakeRay) -> None:
    ray.listed[0]["Resources"].pop("CPU")
    ray.listed[1]["Alive"] = False
    for name in ("aaaaaaaa", "bbbbbbbb"):
        ray.answers["node_problem", name] = GetTimeoutError()
    with RayCluster(AUTO) as cluster:
        check_nodes(cluster)


def test_a_node_that_does_not_see_the_folder_is_refused(tmp_path: Path) -> None:
    problem = node_check._folder_problem(tmp_path / "set" / ".probe")
    assert problem == f"does not see the folder {tmp_path}/set; a dataset must be in a folder that all nodes see"


def test_a_node_that_cannot_write_to_the_folder_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / ".probe").touch()
    assert node_check._folder_problem(tmp_path / ".probe") is None
    monkeypatch.setattr(node_check.os, "access", lambda path, mode: False)
    assert node_check._folder_problem(tmp_path / ".probe") == f"cannot write to {tmp_path}"


def test_the_probe_is_removed_when_a_node_is_refused(ray: FakeRay, tmp_path: Path) -> None:
    ray.answers["node_problem", "bbbbbbbb"] = "cannot write"
    assert re.fullmatch(r"node bbbbbb at 10\.0\.0\.2: cannot write", refusal_of_nodes(tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_is_still_to_be_made_is_checked_where_it_will_be(ray: FakeRay, tmp_path: Path) -> None:
    ray.answers["node_problem", "bbbbbbbb"] = "cannot write"
    assert refusal_of_nodes(tmp_path / "new/export") == "node bbbbbb at 10.0.0.2: cannot write"
    assert list(tmp_path.iterdir()) == []


def test_nodes_that_read_the_same_dataset_are_accepted(ray: FakeRay, tmp_path: Path) -> None:
    bag = tmp_path / "set/scenes/train/Blocks-0000/Blocks-0000_0.mcap"
    bag.parent.mkdir(parents=True)
    bag.write_bytes(b"bag")
    with RayCluster(AUTO) as cluster:
        check_nodes(cluster, reads=[tmp_path / "set", bag.parent, bag])
    assert [path for path in tmp_path.rglob("*") if path.is_file()] == [bag]


@pytest.mark.parametrize("change", [lambda bag: bag.unlink(), lambda bag: bag.write_bytes(b"another bag")])
def test_a_node_that_does_not_see_the_bags_as_they_are_here_is_refused(
    tmp_path: Path, change: Callable[[Path], object]
) -> None:
    bag = tmp_path / "bag.mcap"
    bag.write_bytes(b"bag")
    sample = node_check._Sample.of(tmp_path)
    assert sample.problem() is None
    change(bag)
    assert sample.problem() == f"does not see {tmp_path} as this machine does; all nodes must see it"


def test_the_code_of_the_modules_that_do_the_work_is_compared() -> None:
    known = node_check._inputs.__wrapped__(("simbev_ros.recording.verify",))
    assert "module simbev_ros.recording.verify" in known and "module simbev_ros.production.scene_maker" not in known
