"""Files of another library are read in all versions, and resolved documents satisfy the standard's own schema."""

from importlib import metadata
from pathlib import Path

import pytest

from simbev_ros.scene.storyboard import model
from simbev_ros.scene.storyboard.reading import read_resolved, resolve

pytest.importorskip("scenariogeneration", reason="scenariogeneration is not installed")
lxml = pytest.importorskip("lxml.etree")

from generated_scenario import write_generated_scenario  # noqa: E402

VERSIONS = (0, 1, 2, 3)
NEWER = {
    1: {"GeoPosition", "TrajectoryPosition", "ActivateControllerAction"},
    2: {"SpeedProfileAction", "VariableAction", "VariableCondition", "RelativeClearanceCondition"},
    3: {"AngleCondition", "RelativeAngleCondition", "ClothoidSpline"},
}
"""Actions, conditions, positions and shapes by the version that brought them."""
UNIONS = ("AnyAction", "Test", "Position", "TrajectoryShape", "Body")


def kinds_of(union: str) -> set[str]:
    members = model.TABLE["unions"][union]
    return {kind for member in members for kind in (kinds_of(member) if member in model.TABLE["unions"] else {member})}


@pytest.mark.parametrize("minor", VERSIONS)
def test_every_action_condition_and_position_of_a_version_is_read(minor: int, tmp_path: Path) -> None:
    scenario = resolve(write_generated_scenario(tmp_path, minor)).scenario
    found = {element.kind for element in model.elements_in(scenario)}
    absent = {kind for version, kinds in NEWER.items() if version > minor for kind in kinds}
    absent |= {"LightStateAction"}
    absent |= (
        {"ReachPositionCondition", "ParameterAction"} if minor > 1 else set()
    )  # deprecated; not written any longer
    assert set().union(*map(kinds_of, UNIONS)) - absent <= found


@pytest.mark.parametrize("minor", VERSIONS)
def test_a_resolved_document_has_the_same_model(minor: int, tmp_path: Path) -> None:
    resolved = resolve(write_generated_scenario(tmp_path, minor))
    assert read_resolved(resolved.document) == resolved.scenario


@pytest.mark.parametrize("minor", VERSIONS)
def test_a_resolved_document_satisfies_the_schema_of_version_1_3(minor: int, tmp_path: Path) -> None:
    files = metadata.files("scenariogeneration") or []
    path = next(file for file in files if file.name == "OpenSCENARIO_1_3_1.xsd").locate()
    schema = lxml.XMLSchema(lxml.parse(str(path)))
    schema.assertValid(lxml.fromstring(resolve(write_generated_scenario(tmp_path, minor)).document))


def test_all_elements_of_the_model_are_those_of_the_schema() -> None:
    files = metadata.files("scenariogeneration") or []
    path = next(file for file in files if file.name == "OpenSCENARIO_1_3_1.xsd").locate()
    tree = lxml.parse(str(path))
    names = {name.lower() for name in tree.xpath("//@name")}
    attributes = {spec.attribute for specs in model.SPECS.values() for spec in specs}
    tags = {tag for specs in model.SPECS.values() for spec in specs for tag in (*spec.kinds, spec.wrapper)}
    assert {name for name in attributes | tags if name and name.lower() not in names} == set()
