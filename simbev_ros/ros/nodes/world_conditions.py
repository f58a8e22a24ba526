"""Services that change the conditions of the running scene: /world/set_weather and /world/hold_signal."""

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from pydantic import ValidationError

from simbev_ros.config.base import first_problem
from simbev_ros.config.weather import WEATHER_PARAMETERS, WeatherParameters
from simbev_ros.foundation.errors import InputError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_yaml
from simbev_ros.foundation.units import NS_PER_S
from simbev_ros.maps.build import load_datum
from simbev_ros.maps.network import RoadNetwork
from simbev_ros.scene.drawing.draw_weather import draw_weather
from simbev_ros.schema.scene.spec import SceneSpec
from simbev_ros.schema.scene.state import SignalState, WorldState
from simbev_ros.simulation.world.source import StateSource

SET_WEATHER, HOLD_SIGNAL = "/world/set_weather", "/world/hold_signal"
_SUN = ("sun_azimuth_deg", "sun_altitude_deg")
_MAX_TRANSITION_S = 3600.0


class RunningScene(NamedTuple):
    """The scene that runs, where its states come from, its next tick, its roads, and its latest state."""

    spec: SceneSpec
    source: StateSource
    next_tick: int
    network: RoadNetwork
    state: WorldState | None


class ConditionServices:
    """Answers the calls; without the package simbev_interfaces there are no services.

    Args:
        node: The world node.
        running: Returns the scene that runs; None: none does.
    """

    def __init__(self, node: Any, running: Callable[[], RunningScene | None]) -> None:
        self._running, self._log = running, node.get_logger()
        try:
            from simbev_interfaces.srv import HoldSignal, SetWeather
        except ImportError:
            return
        self._automatic = HoldSignal.Request.STATE_AUTOMATIC
        node.create_service(SetWeather, SET_WEATHER, self._answer(self._set_weather))
        node.create_service(HoldSignal, HOLD_SIGNAL, self._answer(self._hold_signal))

    def _answer(self, act: Callable[[RunningScene, Any], int]) -> Callable[[Any, Any], Any]:
        """Callback of a service that acts on the running scene and answers with a tick, or with what is wrong."""

        def answer(request: Any, response: Any) -> Any:
            try:
                scene = self._running()
                if scene is None:
                    raise InputError("no scene is running")
                with foreign_content("request"):
                    response.tick = act(scene, request)
                response.success = True
            except InputError as error:
                response.message = str(error)
            return response

        return answer

    def _set_weather(self, scene: RunningScene, request: Any) -> int:
        tick = scene.next_tick if request.tick == request.NEXT else request.tick
        if not scene.next_tick <= tick < scene.spec.ticks:
            raise InputError(f"tick: is {tick}; allowed: {scene.next_tick}, the next one, to {scene.spec.ticks - 1}")
        if not 0.0 <= request.transition <= _MAX_TRANSITION_S:
            raise InputError(f"transition: is {request.transition:g} s; allowed: 0 to {_MAX_TRANSITION_S:g} s")
        parameters = _parameters(request.parameters, scene)
        ticks = max(1, math.ceil(request.transition * NS_PER_S / scene.spec.tick_ns - 1e-6))
        scene.source.weather.change(parameters, tick, ticks)
        values = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
        self._log.info(f"weather from tick {tick} on, over {ticks} ticks: {values}")
        return tick

    def _hold_signal(self, scene: RunningScene, request: Any) -> int:
        state = None if request.state == self._automatic else request.state
        if state not in (None, SignalState.RED, SignalState.GREEN):
            raise InputError(f"state: is {state}; allowed: 1 (red), 3 (green), {self._automatic} (automatic)")
        tick = scene.source.hold_signal(request.id, None if state is None else SignalState(state))
        shown = "automatic" if state is None else SignalState(state).name.lower()
        self._log.info(f"traffic light {request.id or 'of every id'}: {shown}, to be seen from tick {tick} on")
        return tick


def _parameters(text: str, scene: RunningScene) -> Mapping[str, float]:
    """New values by name, from the YAML text of a request.

    Raises:
        InputError: The text is not a mapping of parameters to allowed values.
    """
    try:
        given = parse_yaml(text)
        if not isinstance(given, dict) or not given:
            raise InputError(f"must be like {{precipitation: 80}}; names are {', '.join(WEATHER_PARAMETERS)}")
        config = WeatherParameters.model_validate(given)
    except ValidationError as error:
        raise InputError(f"parameters: {first_problem(error)}") from None
    except (InputError, ValueError) as error:
        raise InputError(f"parameters: {error}") from None
    spec = scene.spec
    drawn = draw_weather(config, spec.seed, even_fog=False, datum=load_datum(spec.map), season=spec.map.season)
    names = [name for each in given for name in (_SUN if each == "sun" else (each,))]
    return {name: getattr(drawn, name) for name in names}
