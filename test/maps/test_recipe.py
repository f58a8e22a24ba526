import pytest
from pydantic import ValidationError

from simbev_ros.errors import InputError
from simbev_ros.maps.recipe import TownRecipe, known_maps, recipe_of
from simbev_ros.maps.street_plan import draw_plan


def test_every_recipe_that_ships_is_valid() -> None:
    for name in known_maps():
        assert recipe_of(name).name == name


def test_unknown_town_is_refused() -> None:
    with pytest.raises(InputError, match="known maps: Blocks"):
        recipe_of("../Blocks")


def test_misspelt_field_is_refused() -> None:
    data = recipe_of("Blocks").model_dump(exclude_none=True)
    data["streets"]["colums"] = 4
    with pytest.raises(ValidationError, match="colums"):
        TownRecipe(**data)


def test_ring_road_cannot_be_wide() -> None:
    data = recipe_of("Blocks").model_dump(exclude_none=True)
    data["streets"]["wide_east_west"] = [0]
    with pytest.raises(ValidationError, match="wide_east_west: must lie between 1 and 3, not 0"):
        TownRecipe(**data)


def test_blocks_too_small_for_the_ring_road_are_refused() -> None:
    recipe = recipe_of("Blocks")
    small = recipe.model_copy(update={"streets": recipe.streets.model_copy(update={"block_m": 40.0})})
    with pytest.raises(InputError, match=r"block_m: 40\.0 m is too small"):
        draw_plan(small, 0)


def test_plan_leaves_out_as_many_streets_as_blocks_are_merged() -> None:
    recipe = recipe_of("Blocks")
    whole = recipe.model_copy(update={"streets": recipe.streets.model_copy(update={"merged_blocks": 0})})
    for seed in range(20):
        plan = draw_plan(recipe, seed)
        assert len(draw_plan(whole, seed).streets) - len(plan.streets) == recipe.streets.merged_blocks
        arms = [sum(junction in (street.start, street.end) for street in plan.streets) for junction in plan.junctions]
        assert set(arms) <= {3, 4}
