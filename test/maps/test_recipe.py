from typing import Any

import pytest
from pydantic import ValidationError

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.plan.road_class import road_classes
from simbev_ros.maps.recipe import TownRecipe, recipe_of
from simbev_ros.maps.source import known_maps

MINIMAL: dict[str, Any] = {
    "name": "Minimal",
    "datum": {"latitude_deg": 0, "longitude_deg": 0, "altitude_m": 0},
    "patterns": [{"pattern": "road", "name": "a", "road": "street", "points_m": [[0, 0], [100, 0]]}],
    "surroundings": {"use": "suburb", "plant_density": 0.9, "building_density": 0.1},
}


def test_every_built_in_recipe_is_valid() -> None:
    for name in known_maps():
        assert recipe_of(name).name == name


def test_unknown_town_is_refused() -> None:
    with pytest.raises(InputError, match="known maps: Blocks"):
        recipe_of("../Blocks")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"relif": {}}, "relif"),
        ({"patterns": []}, "patterns"),
        ({"patterns": [{"pattern": "rood"}]}, r"does not match any of the expected tags: 'grid'"),
        (
            {"patterns": [{**MINIMAL["patterns"][0], "road": "strasse"}]},
            r"no road class is called 'strasse'; known: path, lane, street",
        ),
        (
            {"patterns": [{"pattern": "grid", "columns": 4, "rows": 4, "block_m": 100, "wide_east_west": [0]}]},
            "wide_east_west: must lie between 1 and 3, not 0",
        ),
        ({"water": [{"line_m": [[0, 0], [1, 1]], "outline_m": [[0, 0], [1, 0], [1, 1]]}]}, "either line_m"),
        (
            {"zones": [{"circle_m": [0, 0, 5], "polygon_m": [[0, 0], [1, 0], [1, 1]], "surroundings": {}}]},
            "exactly one",
        ),
    ],
)
def test_wrong_field_is_refused_by_name(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        TownRecipe(**{**MINIMAL, **change})


def test_zone_differs_from_the_town_only_in_its_own_fields() -> None:
    zone = {"circle_m": [0, 0, 50], "surroundings": {"use": "park", "building_density": 0.0}}
    surroundings = TownRecipe(**{**MINIMAL, "zones": [zone]}).zones[0].surroundings
    assert (surroundings.use, surroundings.building_density, surroundings.plant_density) == ("park", 0.0, 0.9)


def test_road_class_can_be_like_another() -> None:
    pattern = {**MINIMAL["patterns"][0], "road": {"like": "street", "speed_kmh": 30}}
    kind = TownRecipe(**{**MINIMAL, "patterns": [pattern]}).patterns[0].road  # type: ignore[union-attr]
    assert kind == road_classes()["street"].model_copy(update={"speed_kmh": 30.0})
