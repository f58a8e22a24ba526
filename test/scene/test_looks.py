"""Looks of people: skin, hair and colors of clothes."""

import numpy as np
from scipy import stats

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.scene.drawing.scene_drawer import dressed_for
from simbev_ros.scene.looks import COLUMNS, draw_look, fill_looks, load_looks, skin_colors
from simbev_ros.schema.scene.state import ACTOR_DTYPE
from simbev_ros.schema.scene.weather import Weather


def looks(name, count=2000):
    return [draw_look(blueprint_named(name), stream(3, f"looks.{index}")) for index in range(count)]


def test_the_ten_tones_of_skin_are_equally_frequent():
    counts = np.bincount([look.skin for look in looks("pedestrian.man")], minlength=11)
    assert counts[0] == 0
    assert stats.chisquare(counts[1:]).pvalue > 0.01


def test_light_hair_is_for_light_skin_and_gray_hair_for_old_people():
    hair = {each.color: each.max_skin for each in load_looks().hair}
    drawn = looks("pedestrian.woman")
    assert all(look.skin <= hair[look.hair] for look in drawn)
    assert {look.hair for look in drawn} == set(hair)
    assert {look.hair for look in looks("pedestrian.elder")} == set(load_looks().gray_hair)


def test_only_people_have_looks_which_depend_on_their_ids_and_the_seed():
    rows = np.zeros(4, ACTOR_DTYPE)
    rows["id"], rows["tag"] = [1, 2, 3, 4], [Tag.CAR, Tag.PEDESTRIAN, Tag.PEDESTRIAN, Tag.RIDER]
    rows["blueprint"] = [blueprint_index()[f"pedestrian.{name}"] for name in ("man", "man", "woman", "heavy")]
    first, again, other = rows.copy(), rows[[0, 2]].copy(), rows.copy()
    for table, seed in ((first, 5), (again, 5), (other, 6)):
        fill_looks(table, seed)
    assert not any(first[name][0] for name in COLUMNS)
    assert (first["skin"][1:] > 0).all()
    assert again[1] == first[2]
    assert (first[1:] != other[1:]).all()


def test_recordings_without_a_tone_of_skin_show_a_medium_one():
    assert skin_colors()[0] == skin_colors()[5]
    assert len(skin_colors()) == 11


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
