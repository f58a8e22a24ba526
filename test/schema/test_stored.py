"""What another version has stored is read as far as it is known, and refused if its format is newer."""

import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from index_files import write_index
from made_up_scene import SENSORS, made_up_scene, made_up_spec
from pydantic import ValidationError
from several_agents import made_up_agents

from simbev_ros.dataset import index
from simbev_ros.dataset.index import read_index
from simbev_ros.dataset.index_row import index_row
from simbev_ros.dataset.plan import Plan, PlannedEntry
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.recording.layout import INDEX_FILE, SCENE_ATTACHMENT, scene_folder
from simbev_ros.recording.reader import attached_spec
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.schema.stored import FORMAT, read_stored

PLAN = Plan(scenes=(PlannedEntry(number=3, map="Blocks", split="val"),))


class LaterSpec(SceneSpec):
    """A scene as a later version has it: with one field more, which has a default."""

    snow_depth_m: float = 0.0


class LaterWeather(Weather):
    """Weather as a later version has it."""

    snow: float = 0.0


class LaterPlan(Plan):
    """A plan as a later version has it."""

    min_scenes: int = 0


def objects(value: Any) -> Iterator[dict[str, Any]]:
    """All objects in JSON, at any depth."""
    if isinstance(value, dict):
        yield value
    for part in value.values() if isinstance(value, dict) else value if isinstance(value, list) else ():
        yield from objects(part)


def test_fields_that_are_not_known_are_ignored_in_every_part_of_a_scene() -> None:
    data = made_up_agents().model_dump(mode="json")
    found = list(objects(data))
    assert len(found) > 20
    for each in found:
        each["unheard_of"] = {"nested": [1]}
    assert SceneSpec.from_json(json.dumps(data)) == made_up_agents()
    with pytest.raises(ValidationError, match="unheard_of"):
        SceneSpec.model_validate(data)


@pytest.mark.parametrize(
    ("now", "later", "field"),
    [
        (made_up_spec(SENSORS), LaterSpec, "snow_depth_m"),
        (made_up_spec([]).weather, LaterWeather, "snow"),
        (PLAN, LaterPlan, "min_scenes"),
    ],
    ids=("scene", "weather", "plan"),
)
def test_a_field_that_comes_later_has_its_default_for_earlier_files_and_is_ignored_by_earlier_readers(
    now: Any, later: Any, field: str
) -> None:
    data = now.model_dump(mode="json")
    read = read_stored(later, data)
    assert getattr(read, field) == later.model_fields[field].default
    assert read.model_dump(include=set(data)) == now.model_dump()
    assert read_stored(type(now), read.model_copy(update={field: 7}).model_dump(mode="json")) == now


def test_a_scene_of_a_newer_format_is_refused_whatever_else_has_changed() -> None:
    newer = json.dumps({"format": FORMAT + 1, "actors": {}}).encode()
    message = "bag: scene.json: format: a newer simbev_ros wrote it; allowed: 1 to 1, not 2"
    with pytest.raises(BagError, match=f"^{re.escape(message)}$"):
        attached_spec({SCENE_ATTACHMENT: newer}, Path("bag"))
    with pytest.raises(ValidationError, match="greater than or equal to 1"):
        SceneSpec.from_json(json.dumps(made_up_spec([]).model_dump(mode="json") | {"format": 0}))


def test_a_plan_of_a_newer_format_is_refused(tmp_path: Path) -> None:
    PLAN.save(tmp_path)
    assert json.loads((tmp_path / "plan.json").read_text())["format"] == FORMAT
    assert Plan.load(tmp_path) == PLAN
    (tmp_path / "plan.json").write_text('{"format": 2, "scenes": "elsewhere"}')
    with pytest.raises(InputError, match=r"plan\.json: format: a newer simbev_ros wrote it; allowed: 1 to 1, not 2$"):
        Plan.load(tmp_path)


@pytest.fixture
def dataset(tmp_path: Path) -> Path:
    """A dataset of one scene with its index."""
    bag = scene_folder(tmp_path, "train", "Blocks-0001")
    made_up_scene(bag, number=1)
    write_index(tmp_path, [index_row(bag, tmp_path)])
    return tmp_path


def rewrite(dataset: Path, change: Callable[[Any], Any]) -> None:
    path = dataset / INDEX_FILE
    pq.write_table(change(pq.read_table(path)), path)


def test_columns_of_an_index_that_are_not_known_are_ignored(dataset: Path) -> None:
    before = read_index(dataset)
    assert before[0]["format"] == FORMAT
    rewrite(dataset, lambda table: table.append_column("snow", [[0.5]]))
    assert read_index(dataset) == before


def test_a_column_that_comes_later_has_its_default_in_an_earlier_index(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (before,) = read_index(dataset)
    rewrite(dataset, lambda table: table.drop_columns(["cameras"]))
    with pytest.raises(InputError, match="has a column cameras of the type int64"):
        read_index(dataset)
    monkeypatch.setitem(index.LATER_COLUMNS, "cameras", 0)
    assert read_index(dataset) == [before | {"cameras": 0}]


def test_a_later_parameter_of_the_weather_needs_no_entry_of_its_own(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (before,) = read_index(dataset)
    monkeypatch.setattr(index, "Weather", LaterWeather)
    monkeypatch.setattr(index, "_WEATHER", tuple(LaterWeather.model_fields))
    assert read_index(dataset) == [before | {"snow": 0.0, "final_snow": None}]


def test_an_index_of_a_newer_format_is_refused_whatever_else_has_changed(dataset: Path) -> None:
    rewrite(dataset, lambda table: table.set_column(0, "format", [[FORMAT + 1]]).drop_columns(["cameras"]))
    message = r"index\.parquet: format: a newer simbev_ros wrote it; allowed: 1 to 1, not 2$"
    with pytest.raises(InputError, match=message):
        read_index(dataset)
