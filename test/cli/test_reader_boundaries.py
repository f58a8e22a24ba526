"""Whatever error the innermost part of a reader raises, a command ends with exit code 2 and one line."""

import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import evaluated_dataset as made
import pytest
from made_up_scene import made_up_scene

from simbev_ros.baselines.inference import weights_file
from simbev_ros.baselines.modality import Modality
from simbev_ros.dataset.index import update_index
from simbev_ros.evaluation.predictions.prediction_writer import write_predictions
from simbev_ros.foundation.errors import FOREIGN_ERRORS
from simbev_ros.recording.layout import scenes_of

pytestmark = pytest.mark.usefixtures("no_graph")

Simbev = Callable[..., Any]
KINDS: tuple[type[Exception], ...] = (
    *(ValueError, TypeError, KeyError, IndexError, OverflowError, ZeroDivisionError, RecursionError, MemoryError),
    *(AttributeError, AssertionError, EOFError, NotImplementedError, struct.error),
)
CONFIGURATION = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: []}\nevaluation: {range_m: 50}\n"
READERS = (
    ("run CONFIG", "simbev_ros.config.yaml_file._check"),
    ("run CONFIG", "simbev_ros.config.load._validate"),
    ("evaluate PARQUET EVALUATED --config CONFIG", "simbev_ros.config.evaluation_file.Evaluation.model_validate"),
    ("train CONFIG EVALUATED --out OUT", "simbev_training.training.config.Training.model_validate"),
    ("map FILE.xodr", "simbev_ros.maps.opendrive.importer.read_document"),
    ("map FILE.xodr", "simbev_ros.maps.safe_xml._with_plain_comments"),
    ("map FILE.osm", "simbev_ros.maps.osm.importer.read_osm"),
    ("map FILE.osm.pbf", "simbev_ros.maps.osm.reader.read_pbf"),
    ("map FILE.net.xml", "simbev_ros.maps.sumo.importer.parse"),
    ("map LANELETS", "simbev_ros.maps.lanelet2.importer.read_lanelet_map"),
    ("info BAG", "simbev_ros.recording.mcap.mcap_index.read_summary"),
    ("info BAG", "simbev_ros.recording.reader.SceneSpec.from_json"),
    ("info BAG", "simbev_ros.recording.reader.parse_yaml"),
    ("info BAG --digest", "simbev_ros.recording.reader.read_chunk"),
    ("preview BAG --out OUT", "simbev_ros.recording.mcap.chunk_cache.read_chunk"),
    ("preview BAG --out OUT", "simbev_ros.dataset.values.types_with"),
    ("repair BAG --out OUT", "simbev_ros.recording.mcap.salvage.records_in"),
    ("replay BAG CONFIG", "simbev_ros.recording.reader.types_with"),
    ("generate CONFIG --out DATASET", "simbev_ros.dataset.plan.Plan.from_json"),
    ("info DATASET --no-videos --report OUT", "simbev_ros.dataset.index.pq.ParquetFile"),
    ("evaluate PARQUET EVALUATED --workers 1", "simbev_ros.evaluation.predictions.prediction_files.pq.ParquetFile"),
    ("evaluate NPZ EVALUATED --workers 1", "simbev_ros.foundation.files.unpacking.npy.read_array"),
    ("evaluate MCAP EVALUATED --workers 1", "simbev_ros.recording.mcap.mcap_index.read_summary"),
    ("predict MODEL DATASET --out OUT", "simbev_ros.baselines.inference.parse_json"),
)
"""A command, and the innermost part of a reader of what the command is given."""
CORPUS = Path(__file__).parents[1] / "fuzz/corpus"


def test_every_kind_of_error_is_foreign() -> None:
    assert all(issubclass(kind, FOREIGN_ERRORS) for kind in KINDS)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("inputs")
    bag = folder / "set/scenes/train/Blocks-0000"
    made_up_scene(bag, ticks=2)
    assert update_index(folder / "set", scenes_of(folder / "set"))[1] == {}
    (folder / "set/plan.json").write_text('{"scenes": []}')
    (folder / "good.yaml").write_text(CONFIGURATION)
    (folder / "none.npz").write_bytes((CORPUS / "boxes_npz/valid").read_bytes())
    (folder / "none.mcap").write_bytes((CORPUS / "prediction_bag/valid").read_bytes())
    write_predictions(folder / "boxes.parquet", [(made.NAMES[0], made.as_predicted())])
    for kind, suffix in {"opendrive": "xodr", "osm": "osm", "osm_pbf": "osm.pbf", "sumo": "net.xml"}.items():
        (folder / f"map.{suffix}").write_bytes((CORPUS / kind / "valid").read_bytes())
    (folder / "lanelet2_map.osm").write_bytes((CORPUS / "lanelet2/valid").read_bytes())
    names = {
        "CONFIG": "good.yaml",
        "PARQUET": "boxes.parquet",
        "NPZ": "none.npz",
        "MCAP": "none.mcap",
        "LANELETS": "lanelet2_map.osm",
        "FILE": "map",
        "DATASET": "set",
    }
    found = {name: folder / path for name, path in names.items()}
    return found | {"BAG": bag, "EVALUATED": made.record(folder / "evaluated"), "MODEL": weights_file(Modality.LIDAR)}


@pytest.mark.usefixtures("training")
@pytest.mark.parametrize(("command", "reader"), READERS)
def test_every_error_of_a_reader_is_one_line(
    simbev: Simbev,
    inputs: dict[str, Path],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    command: str,
    reader: str,
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    calls: list[type[Exception]] = []
    for kind in KINDS:

        def fail(*_: object, kind: type[Exception] = kind, **__: object) -> None:
            calls.append(kind)
            raise kind("boom")

        monkeypatch.setattr(reader, fail)
        words = [str(inputs.get(word, word)) for word in command.replace("OUT", str(tmp_path / "out")).split()]
        words = [word.replace("FILE", str(inputs["FILE"])) for word in words]
        answer = simbev(*words)
        lines = answer.err.strip().splitlines()
        assert answer.code == 2 and len(lines) == 1 and "bug" not in lines[0], (kind, answer)
        assert calls[-1] is kind, f"{reader} is not called"
