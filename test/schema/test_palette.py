import numpy as np

from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.schema.palette import bev_color, semantic_color


def bit(name: str) -> int:
    return 1 << BEV_CLASSES.index(name)


def test_tags_have_carlas_colors() -> None:
    tags = np.array([[Tag.ROAD, Tag.CAR], [Tag.PEDESTRIAN, 200]], np.uint8)
    expected = [[[128, 64, 128], [0, 0, 142]], [[220, 20, 60], [0, 0, 0]]]
    assert np.array_equal(semantic_color(tags), expected)
    assert len(np.unique(semantic_color(np.array(list(Tag), np.uint8)), axis=0)) == len(Tag)


def test_every_class_has_a_color_of_its_own() -> None:
    labels = np.array([0, *(bit(name) for name in BEV_CLASSES)], np.uint16)
    assert len(np.unique(bev_color(labels), axis=0)) == len(BEV_CLASSES) + 1


def test_of_several_classes_the_uppermost_is_seen() -> None:
    labels = np.array([bit("road") | bit("bicycle") | bit("rider"), bit("road") | bit("crosswalk")], np.uint16)
    assert np.array_equal(bev_color(labels), bev_color(np.array([bit("rider"), bit("crosswalk")], np.uint16)))
