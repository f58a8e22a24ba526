import pytest
from made_up_scene import made_up_spec
from pydantic import ValidationError

from simbev_ros.config.annotation import Annotation, Occupancy
from simbev_ros.config.load import parse_scenario
from simbev_ros.foundation.errors import InputError
from simbev_ros.schema.scene.agents import agent_view
from simbev_ros.schema.scene.spec import SceneSpec

SCENE = "scenes: [{map: Blocks, train: 1}]\nrig: {sensors: []}\n"


def test_the_default_grid_has_two_million_voxels_around_the_ego() -> None:
    grid = Occupancy().grid
    assert grid.shape == (320, 320, 20) and grid.low_m == (-64.0, -64.0, -1.0) and grid.voxel_m == 0.4
    assert grid.corners_ego.min(axis=0).tolist() == [-64, -64, -1]
    assert grid.corners_ego.max(axis=0).tolist() == pytest.approx([64, 64, 7])


def test_the_finest_voxels_are_allowed_for_the_whole_box() -> None:
    assert Occupancy(voxel_m=0.1).grid.shape == (1280, 1280, 80)


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"voxel_m": 0.3}, "2 half_side_m 128 is not a whole number of voxel_m 0.3"),
        ({"top_m": 7.1}, "top_m - bottom_m 8.1 is not a whole number of voxel_m 0.4"),
        ({"top_m": -1}, "top_m -1 is not above bottom_m -1"),
        ({"half_side_m": 256, "voxel_m": 0.1}, "5120 x 5120 x 80 voxels; allowed are 150,000,000 in all"),
    ],
)
def test_an_invalid_grid_is_refused(fields: dict[str, float], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Occupancy(**fields)


@pytest.mark.parametrize(
    ("annotation", "message"),
    [
        ("{rate_hz: 3}", r"annotation.rate_hz: 3 does not divide the tick rate 20 Hz; allowed are 20, 10, 6.66667, …$"),
        ("{rate_hz: 40}", r"annotation.rate_hz: 40 does not divide the tick rate 20 Hz"),
        ("{rate_hz: 0}", r"annotation.rate_hz: .* greater than 0, not 0"),
        (
            "{rate_hz: 5, occupancy: {rate_hz: 2}}",
            r"annotation.occupancy: rate_hz 2 does not divide annotation.rate_hz 5 Hz; allowed are 5, 2.5, 1.66667, …$",
        ),
        (
            "{rate_hz: 4, vector_map: {rate_hz: 10}}",
            r"annotation.vector_map: rate_hz 10 does not divide annotation.rate_hz 4 Hz",
        ),
    ],
)
def test_a_rate_that_does_not_fit_is_refused_with_the_rates_that_do(annotation: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        parse_scenario(f"{SCENE}annotation: {annotation}\n", "x.yaml")


def test_messages_of_boxes_need_ticks_with_boxes() -> None:
    text = f"{SCENE}annotation: {{rate_hz: 2}}\nagents: [{{name: car, rig: {{sensors: []}}}}]\nv2x: {{}}\n"
    with pytest.raises(InputError, match=r"v2x.rate_hz: 10 does not divide annotation.rate_hz 2 Hz; allowed are 2, 1"):
        parse_scenario(text, "x.yaml")
    parse_scenario(text.replace("v2x: {}", "v2x: {rate_hz: 2}"), "x.yaml")
    parse_scenario(text.replace("name: car", "name: car, annotation: {rate_hz: 10}").replace("{rate_hz: 2}", "{}"), "x")


@pytest.mark.parametrize(
    ("rate_hz", "of_hz", "period_ticks"),
    [(None, None, 1), (None, 4, 5), (2, None, 10), (2, 20, 10), (2, 1, 20), (1, 2, 20), (4, 10, 10), (20, 4, 5)],
)
def test_a_label_is_made_when_labels_and_what_it_is_made_of_are_due(
    rate_hz: float | None, of_hz: float | None, period_ticks: int
) -> None:
    data = made_up_spec([]).model_dump(mode="json")
    data["agents"][0]["annotation"]["rate_hz"] = rate_hz
    assert agent_view(SceneSpec.model_validate(data)).label_period_ticks(of_hz) == period_ticks


def test_without_a_rate_specifications_are_what_they_were() -> None:
    assert "rate_hz" not in Annotation().model_dump()
    assert Annotation(rate_hz=2).model_dump()["rate_hz"] == 2
