import pytest

from simbev_ros.drawing.canvas import Box
from simbev_ros.show.sheet.layout import Column, Row, Tile, place_in_width


def test_two_tiles_share_a_row_by_their_aspects() -> None:
    boxes = place_in_width(Row([Tile("wide", 2.0), Tile("square", 1.0)]), left=5, top=7, width=310, gap_px=10)
    assert boxes == {"wide": Box(5, 7, 200, 100), "square": Box(215, 7, 100, 100)}


def test_all_edges_of_a_nested_layout_are_flush() -> None:
    block = Column([Tile(f"c{i}", 16 / 9) for i in range(2)])
    sheet = Column([Row([Tile(f"r{i}", 16 / 9) for i in range(3)]), Row([block, Tile("a", 1.0), Tile("b", 1.0)])])
    boxes = place_in_width(sheet, left=24, top=80, width=1872, gap_px=10)
    assert boxes["r2"].left + boxes["r2"].width == pytest.approx(24 + 1872, abs=1)
    assert boxes["b"].left + boxes["b"].width == pytest.approx(24 + 1872, abs=1)
    assert boxes["c0"].top == boxes["a"].top == pytest.approx(boxes["r0"].top + boxes["r0"].height + 10, abs=1)
    assert boxes["c1"].top + boxes["c1"].height == pytest.approx(boxes["a"].top + boxes["a"].height, abs=1)
    for key, box in boxes.items():
        assert box.width / box.height == pytest.approx(1 if key in "ab" else 16 / 9, rel=0.01)
