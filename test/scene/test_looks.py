"""Looks of people: skin, hair and colors of clothes."""

import numpy as np
from scipy import stats

from simbev_ros.foundation.random import stream
from simbev_ros.foundation.semantics import Tag
from simbev_ros.scene.blueprints import blueprint_index, blueprint_named
from simbev_ros.scene.looks import COLUMNS, draw_look, fill_looks, load_looks, skin_colors
from simbev_ros.schema.scene.state import ACTOR_DTYPE


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
