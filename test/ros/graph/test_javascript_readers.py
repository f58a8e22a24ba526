"""Foxglove's own JavaScript libraries decode every message of a recorded scene."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from simbev_ros.recording.layout import locate_mcap
from simbev_ros.recording.reader import SceneBag

pytestmark = [pytest.mark.graph, pytest.mark.slow]

SCRIPT = Path(__file__).parent / "javascript"


@pytest.fixture
def decode(tmp_path: Path) -> Path:
    """The decoding script in a folder with its npm packages."""
    if shutil.which("node") is None or shutil.which("npm") is None:
        pytest.skip("Node.js and npm are not installed")
    folder = Path(shutil.copytree(SCRIPT, tmp_path / "javascript"))
    installed = subprocess.run(
        ["npm", "install", "--no-audit", "--no-fund"], cwd=folder, capture_output=True, timeout=300
    )
    if installed.returncode:
        pytest.skip(f"npm cannot install the packages: {installed.stderr.decode()[-300:]}")
    return folder / "decode.mjs"


def test_every_message_is_decoded_with_its_stamp(recorded: Path, decode: Path) -> None:
    output = subprocess.run(
        ["node", str(decode), str(locate_mcap(recorded))], capture_output=True, timeout=120, check=True
    )
    found = json.loads(output.stdout)
    with SceneBag(recorded) as bag:
        expected = {name: topic.stamps_ns.tolist() for name, topic in bag.topics.items() if len(topic.stamps_ns)}
    assert {name: entry["messages"] for name, entry in found.items()} == {name: len(s) for name, s in expected.items()}
    stamped = {name: [int(stamp) for stamp in entry["stamps"]] for name, entry in found.items() if entry["stamps"]}
    assert len(stamped) > 20
    for name, stamps in stamped.items():
        assert stamps == expected[name], name
