"""Looks of people: skin, hair and colors of clothes; what they wear in which weather."""

import numpy as np
from scipy import stats

from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.scene.drawing.scene_drawer import dressed_for
from simbev_ros.scene.looks import load_looks, looks_of
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.schema.scene.weather import Weather

SKIN = load_looks().skin


def people(name, count=4000):
    rows = np.zeros(count, ACTOR_DTYPE)
    rows["id"], rows["tag"], rows["blueprint"] = 1 + np.arange(count), Tag.PEDESTRIAN, blueprint_index()[name]
    rows["color"] = np.random.default_rng(4).choice(blueprint_named(name).colors, count)
    return rows


def test_the_ten_tones_of_skin_are_equally_frequent_and_independent_of_the_other_colors():
    skin, _, second, leather = looks_of(people("pedestrian.man")).T
    counts = [np.count_nonzero(skin == color) for color in SKIN]
    assert sum(counts) == len(skin)
    assert stats.chisquare(counts).pvalue > 0.01
    for other in (second, leather):
        table = [[np.count_nonzero((skin == a) & (other == b)) for a in SKIN] for b in np.unique(other)]
        assert stats.chi2_contingency(table).pvalue > 0.01


def test_light_hair_is_for_light_skin_and_gray_hair_for_old_people():
    max_skin = {each.color: each.max_skin for each in load_looks().hair}
    skin, hair, *_ = looks_of(people("pedestrian.woman")).T.tolist()
    assert all(SKIN.index(tone) + 1 <= max_skin[color] for tone, color in zip(skin, hair, strict=True))
    assert {*hair} == {*max_skin}
    assert {*looks_of(people("pedestrian.elder"))[:, 1].tolist()} == {*load_looks().gray_hair}


def test_only_people_have_looks_which_depend_on_nothing_but_id_color_and_blueprint():
    rows = people("pedestrian.man", 50)
    looks = looks_of(rows)
    moved = rows.copy()
    moved["x"], moved["gait"], moved["vx"] = 5.0, 1.0, 2.0
    np.testing.assert_array_equal(looks_of(moved)[::-1], looks_of(moved[::-1]))
    np.testing.assert_array_equal(looks_of(moved), looks)
    for column in ("id", "color"):
        changed = rows.copy()
        changed[column] += 1000
        assert (looks_of(changed) != looks).any(axis=1).mean() > 0.95
    rows["tag"] = Tag.CAR
    assert not looks_of(rows).any()


def weather(**fields):
    dry = dict.fromkeys(("cloudiness", "precipitation", "precipitation_deposits", "wetness", "wind_intensity"), 0.0)
    light = {"sun_azimuth_deg": 0, "sun_altitude_deg": 40, "fog_density": 0, "fog_distance_m": 0, "fog_falloff": 1}
    return Weather(**{**dry, **light, **fields})


def test_people_have_umbrellas_and_hoods_only_in_rain_and_bare_arms_only_in_warmth():
    dry = [frozenset(dressed_for(weather(), seed)) for seed in range(40)]
    wet = [frozenset(dressed_for(weather(precipitation=60), seed)) for seed in range(40)]
    assert len(set(dry)) == 3
    assert not any("umbrella" in name or "rain_jacket" in name for names in dry for name in names)
    assert all(any("umbrella" in name for name in names) for names in wet)
    assert all(
        ("shorts" in " ".join(names)) != ("coat" in " ".join(names))
        for names in dry
        if "sweater" not in " ".join(names)
    )
    assert not any(".shorts." in name or ".tank_top." in name for names in wet for name in names)


def test_there_are_more_than_ten_thousand_combinations_in_any_weather():
    looks = len(load_looks().skin) * 5 * len(load_looks().leather) * 5
    for rain in (0, 60):
        for seed in range(10):
            assert len(dressed_for(weather(precipitation=rain), seed)) > 25
            assert len(dressed_for(weather(precipitation=rain), seed)) * looks > 10_000
