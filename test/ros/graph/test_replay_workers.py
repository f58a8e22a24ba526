"""Replays by several graphs side by side: the bytes are those of one graph, also after an interrupt."""

import shutil
import signal
from pathlib import Path

import pytest
from generating import Simbev, files, generate, write

pytestmark = [pytest.mark.graph, pytest.mark.slow, pytest.mark.usefixtures("find")]


@pytest.fixture
def dataset(simbev: Simbev, tmp_path: Path) -> Path:
    """Three short scenes on two maps."""
    generate(simbev, write(tmp_path, "{map: Blocks, train: 2}, {map: Town01, val: 1}", has_lidar=False), tmp_path / "a")
    return tmp_path / "a"


@pytest.fixture
def night(tmp_path: Path) -> Path:
    """A configuration with other sensors and another time of day."""
    path = write(tmp_path, "{map: Blocks, train: 1}")
    path.write_text(path.read_text().replace("sun_altitude_deg: 45", "sun_altitude_deg: -40"))
    return path.rename(tmp_path / "night.yaml")


def replay(simbev: Simbev, dataset: Path, config: Path, *more: object) -> str:
    code, output = simbev("replay", dataset, config, *more).finish(600)
    assert code == 0, output
    return output


def test_workers_record_the_bytes_of_one_graph_also_after_an_interrupt(
    simbev: Simbev, dataset: Path, night: Path, tmp_path: Path
) -> None:
    one, two = tmp_path / "one", tmp_path / "two"
    replay(simbev, dataset, night, "--out", one)
    command = simbev("replay", dataset, night, "--out", two, "--workers", 2)
    command.wait_for((two / "logs").is_dir)  # a scene is there, and then its log
    command.process.send_signal(signal.SIGINT)
    code, output = command.finish()
    assert code == 130, output
    assert {path.name for path in two.iterdir()} == {".lock", "index.parquet", "logs", "plan.json", "scenes"}
    assert set(files(two)) < set(files(one)) and not list(two.glob("scenes/*/*.partial"))
    output = replay(simbev, dataset, night, "--out", two, "--workers", 2)
    assert "recorded before" in output
    assert len(files(one)) == 3 and files(two) == files(one) != files(dataset)
    assert {path.name for path in two.iterdir()} == {".lock", "index.parquet", "logs", "plan.json", "scenes"}


def test_workers_record_the_additional_bags_of_one_graph(
    simbev: Simbev, dataset: Path, night: Path, tmp_path: Path
) -> None:
    other = shutil.copytree(dataset, tmp_path / "b")
    replay(simbev, dataset, night, "--merge", "rear")
    replay(simbev, other, night, "--merge", "rear", "--workers", 2)
    assert len(files(dataset)) == 6 and files(other) == files(dataset)
    assert sorted(path.name for path in other.iterdir()) == sorted(path.name for path in dataset.iterdir())
    assert (other / "index.parquet").read_bytes() == (dataset / "index.parquet").read_bytes()
