"""Street lights follow the paper's distribution scene by scene; window colors are those of the scene."""

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import kstest

from simbev_ros.config.draw import Distribution
from simbev_ros.config.lights import BuildingLights, Lights, StreetLights
from simbev_ros.config.load import load_scenario
from simbev_ros.foundation.types import Float64Array
from simbev_ros.scene.drawing.draw_lights import draw_lights, white_balanced_srgb
from simbev_ros.schema.scene.lights import LightSpec, street_lights

POSITIONS_M = np.random.default_rng(5).uniform(-4000.0, 4000.0, (4000, 3)) * [1.0, 1.0, 0.002]


PER_LAMP = Lights(street=StreetLights(change_lm=Distribution(uniform=(-18_000, 18_000))))


def test_nights_follow_the_papers_rule_and_all_lamps_of_one_are_equal() -> None:
    nights = [street_lights(draw_lights(Lights(), seed), POSITIONS_M[:3])["intensity_lm"] for seed in range(2000)]
    assert all(len(set(night.tolist())) == 1 for night in nights)
    check_flux(np.array([night[0] for night in nights], np.float64))


def test_lamps_can_be_drawn_one_by_one() -> None:
    table = street_lights(draw_lights(PER_LAMP, 3), POSITIONS_M)
    flux_lm = table["intensity_lm"].astype(float)
    check_flux(flux_lm)
    assert table["failed"].mean() == pytest.approx(0.1, abs=0.02)
    np.testing.assert_array_equal(table["on"], 1 - table["failed"])
    assert abs(np.corrcoef(table["failed"], flux_lm)[0, 1]) < 0.05


def check_flux(flux_lm: Float64Array) -> None:
    """Check that samples are uniform in 0 to 36,000 lm, with all below 10,000 raised to it."""
    assert flux_lm.min() == 10_000.0
    assert 35_500.0 < flux_lm.max() <= 36_000.0
    mean_lm = (10_000.0**2 + (36_000.0**2 - 10_000.0**2) / 2.0) / 36_000.0
    assert flux_lm.mean() == pytest.approx(mean_lm, abs=4 * 8_700.0 / len(flux_lm) ** 0.5)
    above = flux_lm[flux_lm > 10_000.0]
    assert len(above) / len(flux_lm) == pytest.approx(26 / 36, abs=0.03)
    assert kstest(above, "uniform", (10_000.0, 26_000.0)).pvalue > 0.01


def test_a_lamp_does_not_depend_on_other_loaded_lamps_or_their_order() -> None:
    lights = draw_lights(PER_LAMP, 3)
    all_lamps = street_lights(lights, POSITIONS_M[:200])
    order = np.random.default_rng(1).permutation(200)[:70]
    some = street_lights(lights, POSITIONS_M[order])
    for name in ("x", "y", "z", "intensity_lm", "on", "failed"):
        np.testing.assert_array_equal(some[name], all_lamps[name][order])
    np.testing.assert_array_equal(some["id"], np.arange(1, 71))
    other = street_lights(draw_lights(PER_LAMP, 4), POSITIONS_M[:200])
    assert np.mean(other["intensity_lm"] == all_lamps["intensity_lm"]) < 0.2
    above = street_lights(lights, np.add(POSITIONS_M[:200], [0.0, 0.0, 8.0]))
    assert np.mean(above["intensity_lm"] == all_lamps["intensity_lm"]) < 0.2, "lamps of a bridge are others"


def test_disabling_street_lights_turns_off_all_lamps_without_breaking_any() -> None:
    on, off = (draw_lights(Lights(street=StreetLights(enabled=enabled)), 3) for enabled in (True, False))
    lit, dark = (street_lights(lights, POSITIONS_M) for lights in (on, off))
    assert lit["on"].any()
    assert not dark["on"].any()
    for name in ("intensity_lm", "failed"):
        np.testing.assert_array_equal(lit[name], dark[name])


def test_the_user_can_fix_and_change_every_parameter() -> None:
    config = StreetLights(
        base_lm=Distribution(uniform=(5_000, 6_000)), change_lm=500, minimum_lm=0, failure_probability=0
    )
    lights = draw_lights(Lights(street=config), 3)
    table = street_lights(lights, POSITIONS_M[:50])
    np.testing.assert_allclose(table["intensity_lm"], lights.street.base_lm + 500)
    assert 5_000 <= lights.street.base_lm <= 6_000
    assert LightSpec.model_validate_json(lights.model_dump_json()) == lights


def test_windows_have_random_colors_or_those_of_the_user() -> None:
    palettes = [draw_lights(Lights(), seed).buildings for seed in range(200)]
    assert len({color for palette in palettes for color in palette.colors}) > 400
    shares = [palette.share_lit for palette in palettes]
    assert kstest(shares, "uniform", (0.15, 0.3)).pvalue > 0.01
    own = BuildingLights(colors=(0xFF0000, 0x00FF00), share_lit=1, enabled=False)
    drawn = draw_lights(Lights(buildings=own), 3).buildings
    assert (drawn.colors, drawn.share_lit, drawn.enabled) == ((0xFF0000, 0x00FF00), 1.0, False)


def test_low_temperatures_are_orange_and_high_ones_blue() -> None:
    np.testing.assert_allclose(white_balanced_srgb(3_600.0), 1.0, atol=1e-9)
    red_over_blue = np.array([white_balanced_srgb(kelvin) for kelvin in (2_400.0, 3_000.0, 3_600.0, 5_000.0, 6_500.0)])
    ratio = red_over_blue[:, 0] / red_over_blue[:, 2]
    assert np.all(np.diff(ratio) < 0)
    assert ratio[0] > 1.3
    assert ratio[-1] < 0.9


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({"street": {"failure_probability": 1.2}}, "less than or equal to 1"),
        ({"street": {"base_lm": {"normal": [18_000, 1_000]}}}, "bound it with min and max"),
        ({"buildings": {"colors": [0x1000000]}}, "less than or equal to 16777215"),
        ({"buildings": {"share_lit": 2}}, "0 to 1 is allowed"),
    ],
)
def test_values_out_of_range_are_refused(section: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Lights.model_validate(section)
    assert load_scenario("paper").lights == Lights()
