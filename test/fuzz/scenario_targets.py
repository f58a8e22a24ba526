"""Readers of scenarios in OpenSCENARIO XML: their files, catalogs, values of parameters, and resolved documents."""

import mutation
import numpy as np
from hand_written_scenario import CATALOG, SCENARIO
from target import Target, write_file

from simbev_ros.foundation.errors import InputError
from simbev_ros.scene.storyboard.distributions import variations
from simbev_ros.scene.storyboard.model import elements_in
from simbev_ros.scene.storyboard.reading import read_resolved, resolve


def _resolve(scenario: bytes, catalog: bytes) -> None:
    write_file("scenarios/catalogs/cars.xosc", catalog)
    resolved = resolve(write_file("scenarios/scenario.xosc", scenario))
    assert read_resolved(resolved.document) == resolved.scenario
    assert all(element.origin for element in elements_in(resolved.scenario))


def _read_document(data: bytes) -> None:
    scenario = read_resolved(data.decode(errors="replace"))
    assert scenario.kind == "Scenario"


def _read_values(data: bytes) -> None:
    for variation in variations(write_file("scenarios/values.xosc", data), np.random.default_rng(1)):
        assert variation.path.name


SCENARIO_TARGETS = (
    Target("scenario", lambda data: _resolve(data, CATALOG.encode()), (InputError,), mutation.mutate_xml, examples=40),
    Target(
        "scenario_catalog",
        lambda data: _resolve(SCENARIO.encode(), data),
        (InputError,),
        mutation.mutate_xml,
        examples=40,
    ),
    Target("scenario_document", _read_document, (InputError,), mutation.mutate_xml, examples=40),
    Target("scenario_values", _read_values, (InputError,), mutation.mutate_xml, examples=40),
)
