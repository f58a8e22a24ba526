"""All code that depends on the kind of sensor covers every member of the union of sensor models."""

import ast
import importlib
import pkgutil
from pathlib import Path

import pytest

from simbev_ros import config
from simbev_ros.config.rig import SENSOR_KINDS, Rig
from simbev_ros.config.sensor import Sensor

PACKAGE = Path(config.__file__).parents[1]


def models() -> set[type[Sensor]]:
    """Sensor models that a rig can name: all subclasses of ``Sensor`` with a ``type``."""
    found: set[type[Sensor]] = set()
    for module in pkgutil.iter_modules(config.__path__):
        contents = vars(importlib.import_module(f"{config.__name__}.{module.name}")).values()
        found.update(each for each in contents if isinstance(each, type) and issubclass(each, Sensor))
    return {model for model in found if "type" in model.model_fields}


def test_every_sensor_model_is_in_the_union() -> None:
    assert set(SENSOR_KINDS.values()) == models()


@pytest.mark.parametrize("kind", SENSOR_KINDS)
def test_kind_and_name_are_enough_for_a_sensor_in_a_rig(kind: str) -> None:
    (sensor,) = Rig.model_validate({"sensors": [{"type": kind, "name": "a"}]}).sensors
    assert type(sensor) is SENSOR_KINDS[kind]
    assert sensor.type == kind


def matches() -> dict[str, ast.Match]:
    """Every ``match`` of the package, by file and line."""
    texts = {path: path.read_text(encoding="utf-8") for path in sorted(PACKAGE.rglob("*.py"))}
    return {
        f"{path.relative_to(PACKAGE)}:{node.lineno}": node
        for path, text in texts.items()
        if " match " in text
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.Match)
    }


MATCHES = matches()


@pytest.mark.parametrize(("location", "match"), MATCHES.items(), ids=MATCHES)
def test_every_match_has_a_default_case(location: str, match: ast.Match) -> None:
    """A match that must be exhaustive ends with ``assert_never``, so mypy reports a new member of the union."""
    last = match.cases[-1]
    assert ast.unparse(last.pattern) == "_", f"{location}: end it with `case _: assert_never(…)`, or with a default"
    names = {node.id for case in match.cases for node in ast.walk(case.pattern) if isinstance(node, ast.Name)}
    if names & {model.__name__ for model in SENSOR_KINDS.values()}:
        assert "assert_never" in ast.unparse(last), f"{location}: kinds of sensors have no default"
