"""Tests of the gallery: pictures at their positions on the sheet, rows that fill the width, and the weathers."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from simbev_ros.foundation.types import UInt8Array
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.show.gallery import SHEET_WIDTH_PX, Picture, Section, draw_sheet, even_rows, weather_pictures


def plain(name: str, level: int, width_px: int = 160) -> Picture:
    return Picture(name, name, "", np.full((90, width_px, 3), level, np.uint8))


@pytest.mark.parametrize(
    ("count", "max_length", "rows"), [(12, 4, [4, 4, 4]), (7, 4, [3, 4]), (5, 3, [2, 3]), (1, 4, [1]), (4, 4, [4])]
)
def test_rows_are_even_and_the_first_ones_have_the_larger_pictures(
    count: int, max_length: int, rows: list[int]
) -> None:
    assert even_rows(count, max_length) == rows


def test_every_picture_is_on_the_sheet_in_reading_order() -> None:
    levels = [60, 90, 120, 150, 180]
    result = draw_sheet(Section("s", "Title", "facts", [2, 3]), [plain(str(level), level) for level in levels])
    assert result.shape[1] == SHEET_WIDTH_PX
    inner = SHEET_WIDTH_PX - 2 * 24
    positions = [(250, inner // 4), (250, 3 * inner // 4), *((760, 24 + (2 * k + 1) * inner // 6) for k in range(3))]
    assert [int(result[row, column, 0]) for row, column in positions] == levels
    assert (result[:74, 24:600] > 100).any(), "there is a heading"


def test_the_weathers_cover_all_conditions() -> None:
    seen: list[Weather] = []

    def photograph(weather: Weather, size_px: tuple[int, int]) -> Any:
        seen.append(weather)
        return SimpleNamespace(rgb=np.zeros((*size_px[::-1], 3), np.uint8))

    azimuth: Callable[[float], float] = lambda bearing_deg: bearing_deg % 360.0  # noqa: E731
    view: Any = SimpleNamespace(photograph=photograph, sun_azimuth_deg=azimuth)
    pictures: dict[str, UInt8Array] = {picture.name: picture.rgb for picture in weather_pictures(view, (32, 18))}
    weather = dict(zip(pictures, seen, strict=True))
    assert list(weather) == ["clear", "overcast", "rain", "fog", "dusk", "night", "night_rain"]
    assert [name for name in weather if weather[name].precipitation > 0] == ["rain", "night_rain"]
    assert [name for name in weather if weather[name].sun_altitude_deg < -18] == ["night", "night_rain"]
    assert abs(weather["dusk"].sun_altitude_deg) < 6
    assert max(weather, key=lambda name: weather[name].fog_density) == "fog"
