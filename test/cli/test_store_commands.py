"""Commands on datasets in object stores: info and verify answer as for folders, the others ask for a folder."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from made_up_scene import made_up_scene
from store_server import BUCKET, StoreServer, put_any_key, upload

from simbev_ros.cli.main import VERBS
from simbev_ros.dataset.index import read_index, update_index
from simbev_ros.foundation.object_store.object_path import ObjectPath
from simbev_ros.foundation.object_store.transfers import delete_tree, put_bytes
from simbev_ros.recording.layout import scenes_of

Simbev = Callable[..., Any]
Refused = Callable[..., str]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    dataset = tmp_path_factory.mktemp("commands") / "first"
    for number in range(2):
        made_up_scene(dataset / f"scenes/train/Blocks-000{number}", number=number, ticks=2)
    update_index(dataset, scenes_of(dataset))
    return dataset


@pytest.fixture
def url(folder: Path, store: StoreServer) -> str:
    return upload(folder, "sets/first")


@pytest.mark.parametrize("part", ["", "/scenes/train/Blocks-0001", "/scenes/train/Blocks-0001/Blocks-0001_0.mcap"])
def test_info_is_that_of_the_folder(simbev: Simbev, folder: Path, url: str, part: str) -> None:
    there, here = (simbev("info", f"{place}{part}", "--digest", "--json") for place in (url, folder))
    assert there.code == 0
    assert json.loads(there.out) == json.loads(here.out.replace(str(folder), url))
    assert simbev("info", f"{url}{part}").out == simbev("info", f"{folder}{part}").out.replace(str(folder), url)


def test_the_report_is_that_of_the_folder(simbev: Simbev, folder: Path, url: str, tmp_path: Path) -> None:
    reports = tmp_path / "there", tmp_path / "here"
    for place, report in zip((url, folder), reports, strict=True):
        assert simbev("info", place, "--report", report, "--workers", 1).code == 0
    there, here = (
        {path.relative_to(report): path.read_bytes() for path in report.rglob("*") if path.is_file()}
        for report in reports
    )
    assert there == here and len(there) > 8


def test_info_lists_a_bag_that_is_missing_in_the_store(simbev: Simbev, url: str) -> None:
    delete_tree(ObjectPath(BUCKET, "sets/first/scenes/train/Blocks-0001"))
    answer = simbev("info", url)
    assert answer.code == 0 and "1 of 2 scenes finished" in answer.out
    assert "damaged: there is no dataset and no bag" in " ".join(answer.out.split())


def test_verify_finds_what_it_finds_in_the_folder(simbev: Simbev, folder: Path, url: str) -> None:
    there, here = (simbev("verify", place, "--json", "--workers", 1) for place in (url, folder))
    assert there.code == here.code == 1  # made-up scenes have no accounts
    assert json.loads(there.out) == json.loads(here.out.replace(str(folder), url))


def test_verify_finds_a_flipped_byte_in_a_bag_and_in_a_dataset(simbev: Simbev, folder: Path, url: str) -> None:
    bag = "scenes/train/Blocks-0001"
    content = bytearray((folder / bag / "Blocks-0001_0.mcap").read_bytes())
    content[len(content) // 2] ^= 1
    put_bytes(bytes(content), ObjectPath(BUCKET, f"sets/first/{bag}/Blocks-0001_0.mcap"))
    for place in (url, f"{url}/{bag}"):
        answer = simbev("verify", place, "--json", "--workers", 2)
        faults = json.loads(answer.out)["faults"]
        assert answer.code == 1
        assert any("CRC" in fault["problem"] and fault["bag"] == f"{url}/{bag}" for fault in faults)


@pytest.mark.parametrize(
    "name",
    ["../x", "..", ".", "deep/../../x", "/x", "deep//x", "a\\b", "a\0b", "a\x1b[2J", "x" * 256, "Blocks-0001_0.mcap/x"],
)
def test_a_key_that_no_file_can_have_is_one_fault(
    simbev: Simbev, folder: Path, url: str, store: StoreServer, tmp_path: Path, name: str
) -> None:
    bag = f"{url}/scenes/train/Blocks-0001"
    expected = json.loads(simbev("verify", url, "--json", "--workers", 1).out)["faults"]
    store.reset()
    put_any_key(f"sets/first/scenes/train/Blocks-0001/{name}", b"1")
    answer = simbev("verify", url, "--json", "--workers", 1)
    (fault,) = (found for found in json.loads(answer.out)["faults"] if found not in expected)
    assert answer.code == 1 and fault["bag"] == bag
    assert fault["problem"] == "this cannot be the name of a file in the folder; it is not read"
    assert fault["place"].isprintable() and len(fault["place"]) <= 100
    assert not any(request.startswith("GET") and request.endswith("/x?") for request in store.requests)


def test_keys_that_no_files_can_have_are_one_fault_together(simbev: Simbev, url: str) -> None:
    for index in range(3):
        put_any_key(f"sets/first/scenes/train/Blocks-0001/../{index}", b"1")
    answer = simbev("verify", url, "--workers", 1)
    text = " ".join(answer.out.replace("│", " ").split())
    assert "nor can those of 2 more objects" in text


def test_verify_finds_a_damaged_plan(simbev: Simbev, url: str) -> None:
    put_bytes(b"{", ObjectPath(BUCKET, "sets/first/plan.json"))
    faults = json.loads(simbev("verify", url, "--json", "--workers", 1).out)["faults"]
    assert [(fault["bag"], fault["place"]) for fault in faults][-1] == (url, "plan.json")


def test_folders_and_urls_can_be_verified_together(simbev: Simbev, folder: Path, url: str) -> None:
    assert json.loads(simbev("verify", url, folder, "--json").out)["bags"] == 2 * len(read_index(folder))


@pytest.mark.parametrize("verb", ["info", "verify"])
@pytest.mark.parametrize(
    ("place", "problem"),
    [
        (f"s3://{BUCKET}/none", "there is no dataset and no bag"),
        (f"s3://{BUCKET}/none.mcap", "no such object"),
        ("s3://nobody/none", "there is no bucket 'nobody'"),
        ("s3://", "'' is not a valid bucket name"),
        ("gs://bucket/set", "URLs with gs:// are not supported; allowed: s3://bucket/prefix"),
    ],
)
def test_a_url_that_leads_nowhere_is_refused(
    refused: Refused, store: StoreServer, verb: str, place: str, problem: str
) -> None:
    message = refused(verb, place)
    assert f"error: {place}: " in message and problem in message
    assert len(message.strip().splitlines()) == 1


@pytest.mark.parametrize("verb", ["info", "verify"])
def test_a_cut_off_object_is_refused_or_reported(simbev: Simbev, folder: Path, store: StoreServer, verb: str) -> None:
    content = (folder / "scenes/train/Blocks-0000/Blocks-0000_0.mcap").read_bytes()
    put_bytes(content[:-100], ObjectPath(BUCKET, "cut.mcap"))
    answer = simbev(verb, f"s3://{BUCKET}/cut.mcap")
    assert answer.code == {"info": 2, "verify": 1}[verb]
    assert "cut off" in answer.err + answer.out and f"s3://{BUCKET}" in answer.err + answer.out


@pytest.mark.parametrize("verb", sorted(VERBS.keys() - {"generate", "drop", "info", "logs", "verify"}))
def test_other_commands_say_that_they_need_a_folder(refused: Refused, verb: str) -> None:
    for argument in ("s3://bucket/set", "--out=s3://bucket/set"):
        message = refused(verb, argument)
        assert message.startswith(f"error: s3://bucket/set: simbev {verb} needs a local folder; ")
        assert message.endswith("; generate, drop, info, logs and verify take URLs\n")
