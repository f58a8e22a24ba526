"""Generate and logs with datasets in object stores: what is wrong is found before a graph starts, in one line."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fake_pool import COST
from store_server import BUCKET, StoreServer

from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.dataset.stored_index import StoredIndex
from simbev_ros.foundation.object_store import connection
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import list_objects, put_bytes
from simbev_ros.production import estimate
from simbev_ros.production.estimate import Sample
from simbev_ros.production.scene_log import Attempt, write_scene_log

pytestmark = pytest.mark.usefixtures("no_graph")

Simbev = Callable[..., Any]
Refused = Callable[..., str]
SET = ObjectPath(BUCKET, "sets/a")
CONFIG = """scenes: [{map: Blocks, train: 2}]
rig: {sensors: [{type: imu, name: imu}]}
traffic: {vehicles: 1, pedestrians: 1}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    (tmp_path / "my.yaml").write_text(CONFIG)
    return tmp_path / "my.yaml"


def one_line(message: str) -> str:
    assert len(message.strip().splitlines()) == 1
    return message.removeprefix("error: ").strip()


@pytest.mark.parametrize("more", [(), ("--dry-run",)], ids=["make", "dry run"])
def test_a_store_that_cannot_be_written_to_is_refused(
    refused: Refused, config: Path, store: StoreServer, more: tuple[str, ...]
) -> None:
    store.is_read_only = True
    message = one_line(refused("generate", config, "--out", SET, *more))
    assert message.startswith(f"{SET}/.lock.") and "access was refused (AccessDenied); check the cred" in message
    store.reset()
    assert not list_objects(ObjectPath(BUCKET))


def test_a_store_without_credentials_is_refused(
    refused: Refused, config: Path, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in connection.KEY_VARIABLES:
        monkeypatch.delenv(name)
    message = one_line(refused("generate", config, "--out", SET))
    assert message.startswith(f"{SET}/") and "AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY are not set" in message


def test_other_urls_and_urls_of_configurations_are_refused(refused: Refused, config: Path, store: StoreServer) -> None:
    message = one_line(refused("generate", config, "--out", "gs://bucket/set"))
    assert message == "gs://bucket/set: URLs with gs:// are not supported; allowed: s3://bucket/prefix"
    message = one_line(refused("generate", "s3://bucket/my.yaml", "--out", SET))
    assert message == "s3://bucket/my.yaml: a configuration is a local file; only --out takes a URL"


def test_a_scene_to_replace_that_does_not_exist_is_refused(refused: Refused, config: Path, store: StoreServer) -> None:
    message = one_line(refused("generate", config, "--out", SET, "--replace", 7))
    assert message == "--replace: the dataset has no scene 7; its numbers are 0 to 1"
    assert not list_objects(ObjectPath(BUCKET))


def test_a_dry_run_counts_the_scenes_in_the_store_and_writes_no_object(
    simbev: Simbev, config: Path, store: StoreServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimate, "_measure_sample", lambda *_: Sample(1.0, 0.5, 1e6, 1e3, COST))
    answer = simbev("generate", config, "--out", SET, "--dry-run")
    assert (answer.code, answer.err) == (0, "")
    assert "2 scenes, " in answer.out and " are free)" not in answer.out
    assert not list_objects(ObjectPath(BUCKET))


def test_logs_are_read_from_the_store(simbev: Simbev, store: StoreServer) -> None:
    StoredIndex(SET)
    Plan().with_entries([PlannedEntry(number=3, map="Blocks", split="train")]).save(SET)
    write_scene_log(SET, Attempt("Blocks-0003", 1, "worker-1"), "died", {"world": "a line\n"}, failed=True)
    write_scene_log(SET, Attempt("Blocks-0003", 2, ""), "duration after tick 9", {})
    answer = simbev("logs", SET, 3)
    assert (answer.code, answer.err) == (0, "")
    headings = [line.rstrip("─ ") for line in answer.out.splitlines() if line.endswith("──")]
    assert headings == ["Blocks-0003.failed-1.log", "Blocks-0003.log"] and "died\n--- world\na line\n" in answer.out


@pytest.mark.parametrize(
    ("url", "problem"),
    [(str(SET), "there is no dataset"), ("s3://nobody/set", "there is no bucket 'nobody'")],
)
def test_logs_of_nothing_are_refused(refused: Refused, store: StoreServer, url: str, problem: str) -> None:
    assert one_line(refused("logs", url, 0)) == f"{url}: {problem}"


def test_a_scene_without_a_log_in_the_store_is_refused(refused: Refused, store: StoreServer) -> None:
    StoredIndex(SET)
    put_bytes(b'{"scenes": [{"number": 0, "map": "Blocks", "split": "train"}]}', SET / "plan.json")
    assert "scene Blocks-0000 has no log yet" in one_line(refused("logs", SET, 0))
