"""Each release of ROS 2 that is supported records the same bytes."""

import sys
from pathlib import Path

import pytest
from commands import Command, record, write_small

from simbev_ros.recording.digest import topic_digests
from simbev_ros.recording.reader import SceneBag

KILTED = Path(sys.prefix).with_name(".venv-kilted") / "bin/python"

pytestmark = pytest.mark.graph


@pytest.mark.skipif(not KILTED.exists(), reason="there is no ROS 2 Kilted: SIMBEV_ROS=kilted ./simbev setup")
def test_kilted_records_the_bytes_of_jazzy(recorded: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", str(KILTED))
    for name in ("LD_LIBRARY_PATH", "AMENT_PREFIX_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE"):  # which Jazzy has set here
        monkeypatch.delenv(name, raising=False)
    config = write_small(tmp_path, more="recording: {forms: [tables, messages]}\n")
    kilted = record(Command, config, tmp_path / "dataset")
    with SceneBag(recorded) as expected, SceneBag(kilted) as found:
        assert dict(topic_digests(found)) == dict(topic_digests(expected))
