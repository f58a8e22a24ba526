from collections import Counter
from copy import deepcopy

import pytest
from catalog_models import model
from pydantic import ValidationError

from simbev_ros.assets.actors.shape import Shape, load_shape
from simbev_ros.assets.actors.variants import Reshape, load_variants, reshape_shape
from simbev_ros.scene.blueprints import blueprint_named, load_blueprints

FOUR_WHEELED = [entry for entry in load_blueprints() if entry.kind == "vehicle" and not entry.rider]
BASE = {
    "wheels": {"radius": 0.3, "width": 0.2, "axles": [1.2, -1.2], "half_track": 0.8},
    "doors": [{"name": "front", "hinge": [0.8, 0.9], "seat": [0.0, 0.4, 0.5]}],
    "shells": [
        {
            "sides": [1.6, -1.6],
            "side": 2,
            "arches": [{"x": 1.2, "z": 0.3, "radius": 0.36}],
            "loops": [
                {"name": "low", "z": 0.2, "half": 0.8, "front": 2.0, "rear": -2.0},
                {"name": "crease", "z": [[1.0, 0.8], [-1.0, 0.9]], "half": 0.8, "front": 2.0, "rear": -2.0},
                {"name": "edge", "z": 1.0, "half": 0.8, "front": 1.8, "rear": -1.8, "sides": [1.5, -1.5]},
            ],
            "patches": [
                {"finish": "chrome", "rows": ["low", "crease"], "front": [0, 0.4], "side": [1.0, 0.0]},
                {"finish": "tail", "rows": ["low", "crease"], "rear": [0, 0.4]},
                {"finish": "glass", "rows": ["crease", "edge"], "front": [0, 0.9]},
            ],
        }
    ],
    "solids": [
        {"shape": "box", "finish": "chrome", "size": [2.0, 0.1, 0.1], "at": [0.0, 0.5, 0.9]},
        {"shape": "box", "finish": "black", "size": [0.2, 0.1, 0.1], "at": [1.5, 0.9, 1.0]},
        {"shape": "tube", "finish": "alloy", "path": [[0.0, 0.5, 1.0], [-1.5, 0.5, 1.0]]},
    ],
}


def changed(**fields):
    return reshape_shape(deepcopy(BASE), Reshape.model_validate(fields))


def test_lengths_between_stations_are_stretched_and_those_beyond_only_move():
    shape = changed(x=[[1.2, 1.5], [-1.2, -1.0]], z=[[0.5, 0.5], [1.0, 1.2]], y=0.5)
    low, crease, edge = shape["shells"][0]["loops"]
    assert shape["wheels"]["axles"] == [1.5, -1.0]
    assert (low["front"], low["rear"]) == pytest.approx((2.3, -1.8))
    assert edge["sides"] == pytest.approx([1.8, -1.3])
    assert crease["z"][0] == pytest.approx([1.5 - 0.2 * 2.5 / 2.4, 0.92], abs=1e-4)
    assert (low["z"], edge["z"]) == pytest.approx((0.2, 1.2))
    assert (low["half"], shape["wheels"]["half_track"]) == pytest.approx((0.4, 0.4))
    assert shape["doors"][0]["hinge"] == pytest.approx([1.5 - 0.4 * 2.5 / 2.4, 0.45], abs=1e-4)
    assert shape["shells"][0]["side"] == 2  # a number of cells, not a position


def test_large_solids_are_stretched_and_small_ones_keep_their_size():
    rail, mirror, tube = changed(x=[[1.0, 1.5], [-1.0, -1.0]])["solids"]
    assert (rail["size"][0], rail["at"][0]) == pytest.approx((2.5, 0.25))
    assert (mirror["size"][0], mirror["at"][0]) == pytest.approx((0.2, 2.0))
    assert [tube["at"][0] + point[0] for point in tube["path"]] == pytest.approx([0.25, -1.5])


def test_arches_grow_with_the_wheels_and_stay_concentric():
    shape = changed(wheels={"radius": 0.36, "spokes": 7})
    assert shape["wheels"]["spokes"] == 7
    arch = shape["shells"][0]["arches"][0]
    assert (arch["x"], arch["z"], arch["radius"]) == pytest.approx((1.2, 0.36, 0.432))


def test_a_face_replaces_the_front_below_the_windows_alone():
    patches = changed(styles=["face_bar"])["shells"][0]["patches"]
    assert {"finish": "chrome", "rows": ["low", "crease"], "side": [1.0, 0.0]} in patches
    assert BASE["shells"][0]["patches"][1] in patches
    face = load_variants()["styles"]["face_bar"]
    assert patches[-len(face) :] == face


def test_a_moved_end_of_a_loop_takes_the_end_of_its_side_along():
    low, _, edge = changed(loops=[{"low": {"rear": -2.3}, "edge": {"front": 2.0, "rise": 0.1, "wide": 0.5}}])["shells"][
        0
    ]["loops"]
    assert (low["rear"], low["sides"]) == (-2.3, pytest.approx([1.6, -1.9]))
    assert (edge["front"], edge["sides"]) == (2.0, pytest.approx([1.7, -1.5]))
    assert (edge["z"], edge["half"]) == pytest.approx((1.1, 0.4))


def test_solids_are_dropped_finishes_swapped_and_shells_removed_or_added():
    shape = changed(drop=[{"shape": "tube"}], swap={"chrome": "black"}, shells=[{"cap": "glass"}, {"sides": [1, 0]}])
    assert [solid["finish"] for solid in shape["solids"]] == ["black", "black"]
    assert shape["shells"][0]["patches"][0]["finish"] == "black"
    assert [shell.get("cap") for shell in shape["shells"]] == ["glass", None]
    assert changed(shells=[None])["shells"] == []


def test_an_unknown_change_is_refused():
    with pytest.raises(ValidationError, match="colour"):
        changed(colour="red")


@pytest.mark.parametrize("name", load_variants()["shapes"])
def test_each_variant_is_a_valid_shape_of_another_form_than_its_base(name):
    shape, base = load_shape(name), load_variants()["shapes"][name].get("extends")
    assert isinstance(shape, Shape)
    assert base is None or shape != load_shape(base)


def test_there_are_sixty_bodies_with_four_wheels_and_none_looks_like_another():
    looks = Counter((entry.size_m, len(model(entry.name).mesh.triangles)) for entry in FOUR_WHEELED)
    assert len(FOUR_WHEELED) >= 60
    assert max(looks.values()) == 1


def test_paints_of_cars_are_as_frequent_as_in_the_report_and_vary():
    colors = Counter(blueprint_named("vehicle.compact").colors)
    assert len(colors) >= 160
    by_channel = [((color >> 16) & 255, (color >> 8) & 255, color & 255) for color in colors.elements()]
    gray = [max(rgb) for rgb in by_channel if max(rgb) - min(rgb) < 40]
    assert sum(value > 215 for value in gray) / len(by_channel) == pytest.approx(0.34, abs=0.03)  # white
    assert sum(value < 45 for value in gray) / len(by_channel) == pytest.approx(0.21, abs=0.03)  # black
    assert 0.2 < sum(45 <= value <= 215 for value in gray) / len(by_channel) < 0.33  # gray and silver


def test_a_row_takes_what_it_omits_from_the_row_that_it_is_like():
    luton, van = blueprint_named("vehicle.luton_van"), blueprint_named("vehicle.van")
    assert (luton.tag, luton.sumo_class, luton.accel) == (van.tag, van.sumo_class, van.accel)
    assert luton.size_m != van.size_m
    assert luton.colors != van.colors
