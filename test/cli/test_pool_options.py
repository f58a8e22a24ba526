"""The options --workers and --ray of all commands: what they mean, and what is refused before anything is written."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_ray import FakeRay, install_fake_ray
from made_up_scene import made_up_scene
from store_server import StoreServer, upload

from simbev_ros.cli.pool import worker_count
from simbev_ros.production.cluster import node_check

pytestmark = pytest.mark.usefixtures("no_graph")

Refused = Callable[..., str]
CODE = {"python": b"3.12"}
ON_CLUSTERS = ["verify SET", "export simbev SET --out OUT", "export nuscenes SET --out OUT"]
OTHERS = ["info SET", "evaluate SET SET"]
MAKERS = ["generate demo --out OUT", "replay BAG demo --out OUT"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pool")
    for number in range(2):
        made_up_scene(folder / f"set/scenes/train/Blocks-000{number}", number=number, ticks=2)
    return folder


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """A cluster of two nodes that run the same code as this machine."""
    monkeypatch.setattr(node_check, "_inputs", lambda modules: CODE)
    fake = install_fake_ray(monkeypatch)
    for name in ("aaaaaaaa", "bbbbbbbb"):
        fake.add_node(name)
    return fake


def words(command: str, folder: Path, out: Path) -> list[str]:
    """A command with paths in place of the capitals."""
    paths = {"SET": folder / "set", "BAG": folder / "set/scenes/train/Blocks-0000", "OUT": out}
    return [str(paths.get(word, word)) for word in command.split()]


@pytest.mark.parametrize("text", ["0", "-1", "x", "1025", "٣", "", "1.5", "+3", " 3", "AUTO", "9" * 5000, "[/no]"])
@pytest.mark.parametrize("command", [*ON_CLUSTERS, *OTHERS, *MAKERS, f"{MAKERS[0]} --dry-run"])
def test_a_bad_number_of_workers_is_refused_in_one_line(
    refused: Refused, folder: Path, tmp_path: Path, command: str, text: str
) -> None:
    message = refused(*words(command, folder, tmp_path / "out"), f"--workers={text}")
    most = 1024 if command in ON_CLUSTERS + OTHERS else 60
    assert message == f"error: --workers: is {text!r:.80}; allowed: 1 to {most}, or auto\n"
    assert not (tmp_path / "out").exists()


def test_numbers_up_to_the_limit_and_auto_are_allowed() -> None:
    assert [worker_count(text, 60) for text in (None, "auto", "1", "07", "60")] == [None, "auto", 1, 7, 60]


@pytest.mark.parametrize("value", ["auto", "2"])
def test_a_number_of_workers_or_auto_is_accepted(simbev: Callable[..., Any], folder: Path, value: str) -> None:
    assert simbev("info", folder / "set", "--workers", value).code == 0


@pytest.mark.parametrize("address", ["x", "10.0.0.5", "ray://a:1", "[/no]"])
@pytest.mark.parametrize("command", ON_CLUSTERS + MAKERS)
def test_a_bad_address_is_refused_in_one_line(
    refused: Refused, folder: Path, tmp_path: Path, ray: FakeRay, command: str, address: str
) -> None:
    message = refused(*words(command, folder, tmp_path / "out"), "--ray", address)
    allowed = "allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379"
    assert message.splitlines()[-1] == f"error: --ray: is {address!r}; {allowed}"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ON_CLUSTERS + MAKERS)
def test_workers_beside_a_cluster_are_refused(
    refused: Refused, folder: Path, tmp_path: Path, ray: FakeRay, command: str
) -> None:
    message = refused(*words(command, folder, tmp_path / "out"), "--ray", "auto", "--workers", 2)
    expected = "error: --workers: is for this machine alone; a cluster has as many as there is room for"
    assert message.splitlines()[-1] == expected and not ray.is_open and not (tmp_path / "out").exists()


@pytest.mark.parametrize("command", ON_CLUSTERS)
def test_a_node_that_sees_no_dataset_is_refused_before_anything_is_written(
    refused: Refused, folder: Path, tmp_path: Path, ray: FakeRay, command: str
) -> None:
    problem = "does not see /shared/set as this machine does; all nodes must see it"
    ray.answers["node_problem", "bbbbbbbb"] = problem
    message = refused(*words(command, folder, tmp_path / "out"), "--ray", "auto")
    assert message.splitlines()[-1] == f"error: node bbbbbb at 10.0.0.2: {problem}"
    assert list(tmp_path.iterdir()) == [] and not ray.is_open


@pytest.mark.parametrize("command", OTHERS)
def test_commands_that_a_cluster_would_not_make_faster_have_no_such_option(
    refused: Refused, folder: Path, tmp_path: Path, command: str
) -> None:
    assert "No such option: --ray" in refused(*words(command, folder, tmp_path / "out"), "--ray", "auto")


def test_a_dataset_in_a_store_is_verified_on_a_cluster_as_on_this_machine(
    simbev: Callable[..., Any], folder: Path, ray: FakeRay, store: StoreServer
) -> None:
    url = upload(folder / "set", "sets/first")
    here, there = simbev("verify", url, "--json"), simbev("verify", url, "--json", "--ray", "auto")
    assert there.out == here.out and there.code == here.code


@pytest.mark.parametrize("command", ON_CLUSTERS)
def test_relative_paths_mean_the_same_on_all_nodes(
    simbev: Callable[..., Any],
    folder: Path,
    tmp_path: Path,
    ray: FakeRay,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
) -> None:
    monkeypatch.chdir(folder)
    answer = simbev(*command.replace("SET", "set").replace("OUT", str(tmp_path / "out")).split(), "--ray", "auto")
    assert ray.tasks and all("PosixPath('set" not in repr(task.arguments) for task in ray.tasks), answer
