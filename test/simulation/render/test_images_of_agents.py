"""Images of several agents from one renderer: each agent's are those that it would have alone."""

from collections.abc import Callable, Iterator, Mapping
from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from render_scene import CAMERA, NOON, car, front_pose, scene, world
from several_agents import made_up_agents

from simbev_ros.config.modalities import MODALITIES
from simbev_ros.foundation.geometry.camera import LensCamera
from simbev_ros.foundation.geometry.transforms import matrices_from_xyz_rpy
from simbev_ros.schema.scene.agents import agent_views
from simbev_ros.schema.scene.state import EGO_ID, Light, WorldState
from simbev_ros.schema.scene.weather import Weather
from simbev_ros.simulation.render.frame import CameraImages, CameraView, RenderFrame
from simbev_ros.simulation.render.geometry.static_geometry import StaticGeometry
from simbev_ros.simulation.render.renderer import Renderer

pytestmark = [pytest.mark.gl, pytest.mark.slow]

VIEWS = {view.agent: view for view in agent_views(made_up_agents())}
EGO, CAR, STATION = VIEWS
CAR_ID = VIEWS[CAR].ego_id
NIGHT = {"sun_altitude_deg": -40.0}
RAIN = {"cloudiness": 90.0, "precipitation": 100.0, "wetness": 80.0, "precipitation_deposits": 80.0}
WEATHERS: dict[str, dict[str, float]] = {
    "low sun": {"sun_azimuth_deg": 200.0, "sun_altitude_deg": 20.0},
    "rainy night": RAIN | NIGHT,
    "dusk": {"sun_altitude_deg": 1.0},
    "clouds": {"cloudiness": 100.0},
    "night": NIGHT,
    "rain": RAIN,
}
LENS = LensCamera(120, 68, 70.0, 70.0, 59.5, 33.5, (-0.25, 0.08, 0.001, -0.0005, -0.01))
DOWN = matrices_from_xyz_rpy(np.array([0.0, 0.0, 25.0]), np.array([0.0, np.pi / 2, 0.0]))
"""Looks straight down from 25 m; the top of the image is ahead of the agent."""
STANDING = {EGO_ID: 0.0, CAR_ID: 40.0}
"""x of two vehicles that are in different cells of all shadow maps."""


def state_at(tick: int, weather: Weather = NOON) -> WorldState:
    """The ego drives ahead, the other agent's car comes toward it, and a third car turns on the spot."""
    headlamps = Light.LOW_BEAM.value
    return world(
        {"id": EGO_ID, "x": 4.0 * tick - 3.0, "vx": 80.0, "lights": headlamps},
        {"id": 2, "x": 16.0, "y": -6.0, "yaw": 0.1 * tick},
        {"id": CAR_ID, "x": 36.0 - 9.0 * tick, "y": 1.5, "yaw": np.pi, "vx": -90.0, "lights": headlamps},
        weather=weather,
    )


def two_cars(positions_m: Mapping[int, float]) -> WorldState:
    """Two agents' cars, by id their positions along x."""
    return world(*({"id": id, "x": x_m} for id, x_m in positions_m.items()))


def photograph(
    renderer: Renderer, agent: str, state: WorldState, previous: WorldState | None = None
) -> list[CameraImages]:
    """Images of a pinhole camera and of a distorted one that looks backward."""
    back = front_pose() @ matrices_from_xyz_rpy(np.zeros(3), np.array([0.0, 0.0, np.pi]))
    cameras = [CameraView(CAMERA, front_pose(), MODALITIES), CameraView(LENS, back, MODALITIES)]
    before = None if previous is None else VIEWS[agent].ego_state(previous)
    return renderer.render(cameras, RenderFrame(VIEWS[agent].ego_state(state), before))


def look_down(renderer: Renderer, agent: str, state: WorldState, **changes: Any) -> CameraImages:
    view = CameraView(CAMERA, DOWN, ("rgb", "instance"), **changes)
    [images] = renderer.render([view], RenderFrame(VIEWS[agent].ego_state(state)))
    return images


def film(
    renderers: Mapping[str, Renderer], weather: Weather, ticks: int = 2
) -> dict[tuple[int, str], list[CameraImages]]:
    """Images by tick and agent, each agent's from its own or a shared renderer."""
    states = [state_at(tick, weather) for tick in range(ticks)]
    return {
        (tick, agent): photograph(renderers[agent], agent, states[tick], states[tick - 1] if tick else None)
        for tick, agent in product(range(ticks), renderers)
    }


@pytest.fixture(scope="module")
def make_renderer() -> Iterator[Callable[..., Renderer]]:
    made: list[Renderer] = []

    def make(**options: Any) -> Renderer:
        made.append(Renderer(scene(), [car()], **options))
        return made[-1]

    yield make
    for renderer in made:
        renderer.close()


@pytest.fixture(scope="module")
def alone(make_renderer: Callable[..., Renderer]) -> dict[str, Renderer]:
    """A renderer for each agent."""
    return {agent: make_renderer() for agent in VIEWS}


@pytest.fixture(scope="module")
def shared(make_renderer: Callable[..., Renderer]) -> Renderer:
    """A renderer for all agents."""
    return make_renderer()


def assert_equal_images(found: Mapping[Any, list[CameraImages]], expected: Mapping[Any, list[CameraImages]]) -> None:
    for key, camera, modality in product(expected, range(2), MODALITIES):
        images = (getattr(each[key][camera], modality) for each in (found, expected))
        np.testing.assert_array_equal(*images, err_msg=f"{key}, camera {camera}, {modality}")


@pytest.mark.parametrize(
    "weather",
    ["rainy night", *(pytest.param(name, marks=pytest.mark.slow) for name in sorted({*WEATHERS} - {"rainy night"}))],
)
def test_images_drawn_in_turns_are_those_of_each_agent_alone(
    alone: dict[str, Renderer], shared: Renderer, weather: str
) -> None:
    changed = NOON.model_copy(update=WEATHERS[weather])
    shared.set_agents(len(VIEWS))
    expected = film(alone, changed)
    assert_equal_images(film(dict.fromkeys(VIEWS, shared), changed), expected)
    first = [expected[0, agent][0].rgb for agent in VIEWS]
    assert not any(np.array_equal(one, other) for one, other in pairwise(first))


def test_the_same_holds_for_images_from_compute_shaders(make_renderer: Callable[..., Renderer]) -> None:
    weather = NOON.model_copy(update=WEATHERS["rainy night"])
    alone, shared = (make_renderer(use_compute=True) for _ in range(2))
    shared.set_agents(len(VIEWS))
    assert_equal_images(film(dict.fromkeys(VIEWS, shared), weather), film({CAR: alone}, weather))


@pytest.fixture
def shadow_passes(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the programs with which static geometry has been drawn into shadow maps and maps of open sky, so far."""
    passes = []
    draw_around = StaticGeometry.draw_around

    def count(geometry: StaticGeometry, program: str, *values: Any) -> None:
        passes.append(program)
        draw_around(geometry, program, *values)

    monkeypatch.setattr(StaticGeometry, "draw_around", count)
    return passes


def test_the_static_shadow_of_agents_that_take_turns_is_drawn_once_per_cell(
    make_renderer: Callable[..., Renderer], shadow_passes: list[str]
) -> None:
    renderer = make_renderer()
    renderer.set_agents(2)

    def passes(*positions_m: float) -> int:
        """Number of maps drawn in two rounds with the two agents at these positions."""
        already = len(shadow_passes)
        for agent in (EGO, CAR) * 2:
            look_down(renderer, agent, two_cars(dict(zip(STANDING, positions_m, strict=True))))
        return len(shadow_passes) - already

    assert passes(*STANDING.values()) == 6, "a near and a far square and the open sky for each agent"
    assert passes(*STANDING.values()) == 0
    assert passes(6.0, 40.0) == 1, "one agent has entered the next small cell of the same large one"
    assert passes(6.0, 70.0) == 3, "the other one has entered other cells of all sizes"
    assert passes(6.0, 6.5) == 0, "agents in the same cells share what is drawn"


def test_agents_that_share_one_map_have_it_drawn_anew_in_each_turn(
    alone: dict[str, Renderer], make_renderer: Callable[..., Renderer], shadow_passes: list[str]
) -> None:
    expected = film(alone, NOON)
    shadow_passes.clear()
    found = film(dict.fromkeys(VIEWS, make_renderer()), NOON)
    assert len(shadow_passes) >= len(found)
    assert_equal_images(found, expected)


def test_an_agent_sees_all_cars_but_its_own_and_a_roadside_unit_sees_all(shared: Renderer) -> None:
    unit = VIEWS[STATION].station
    assert unit is not None
    state = world(
        *(
            {"id": id, "x": unit.x_m + side_m, "y": unit.y_m, "z": unit.z_m}
            for id, side_m in ((EGO_ID, 3.0), (CAR_ID, -3.0))
        )
    )
    seen = {agent: set(np.unique(look_down(shared, agent, state).instance)) for agent in VIEWS}
    assert seen == {EGO: {0, CAR_ID}, CAR: {0, EGO_ID}, STATION: {0, EGO_ID, CAR_ID}}


def test_flow_of_a_roadside_unit_is_zero_where_nothing_moves(shared: Renderer) -> None:
    before, now = (world({"id": EGO_ID, "x": -20.0}, {"id": CAR_ID, "x": x_m, "y": 5.0}) for x_m in (11.0, 12.5))
    [images, _] = photograph(shared, STATION, now, before)
    assert images.flow is not None and images.instance is not None
    assert np.nanmax(np.abs(images.flow[images.instance == 0])) < 1e-3
    moving = images.instance == CAR_ID
    assert moving.any() and np.nanmax(np.abs(images.flow[moving])) > 1.0


def test_agents_with_equal_cameras_have_different_drops_on_their_lenses(shared: Renderer) -> None:
    state = world({"id": EGO_ID}, weather=NOON.model_copy(update=RAIN))
    plain, first, other, again = (
        look_down(shared, EGO, state, **changes).rgb
        for changes in ({}, {"lens_seed": 0}, {"lens_seed": 7 << 40 | 5}, {"lens_seed": 7 << 40 | 5})
    )
    np.testing.assert_array_equal(plain, first)
    np.testing.assert_array_equal(other, again)
    assert first is not None and other is not None
    assert 0.001 < np.any(first != other, axis=2).mean() < 0.5, "drops cover a part of the image"
