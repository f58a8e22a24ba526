import numpy as np

from simbev_ros.foundation.semantics import BEV_CLASSES, Tag
from simbev_ros.schema.palette import bev_color, semantic_color


def bit(name: str) -> int:
    return 1 << BEV_CLASSES.index(name)


def test_tags_have_the_colors_of_carlas_cityscapes_palette() -> None:
    palette = [
        *((0, 0, 0), (128, 64, 128), (244, 35, 232), (70, 70, 70), (102, 102, 156), (190, 153, 153), (153, 153, 153)),
        *((250, 170, 30), (220, 220, 0), (107, 142, 35), (152, 251, 152), (70, 130, 180), (220, 20, 60), (255, 0, 0)),
        *((0, 0, 142), (0, 0, 70), (0, 60, 100), (0, 80, 100), (0, 0, 230), (119, 11, 32), (110, 190, 160)),
        *((170, 120, 50), (55, 90, 80), (45, 60, 150), (157, 234, 50), (81, 0, 81), (150, 100, 100)),
        *((230, 150, 140), (180, 165, 180)),
    ]
    assert np.array_equal(semantic_color(np.arange(len(Tag), dtype=np.uint8)), palette)
    assert semantic_color(np.array([200], np.uint8)).tolist() == [[0, 0, 0]]


def test_every_class_has_a_color_of_its_own() -> None:
    labels = np.array([0, *(bit(name) for name in BEV_CLASSES)], np.uint16)
    assert len(np.unique(bev_color(labels), axis=0)) == len(BEV_CLASSES) + 1


def test_of_several_classes_the_uppermost_is_seen() -> None:
    labels = np.array([bit("road") | bit("bicycle") | bit("rider"), bit("road") | bit("crosswalk")], np.uint16)
    assert np.array_equal(bev_color(labels), bev_color(np.array([bit("rider"), bit("crosswalk")], np.uint16)))
