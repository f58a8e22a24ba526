"""Services of simulation_interfaces that steer the simulation as a whole: its state, steps, resets and worlds.

They order scenes like /world/load_scene, and pause and step the world node through its own services. Those of single
entities are in the world node.
"""

import json
import threading
import time
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any

from rclpy.action.server import ActionServer, CancelResponse, ServerGoalHandle
from std_srvs.srv import SetBool, Trigger

from simbev_ros.config.map_files import suffix_of
from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError, SimbevError, foreign_content
from simbev_ros.foundation.files.structured_text import parse_yaml
from simbev_ros.maps.source import known_maps
from simbev_ros.ros.conventions.names import ros_name
from simbev_ros.ros.conventions.simulation_interfaces import (
    DELETE_SPAWNED,
    RUN_STATUS,
    Act,
    Refused,
    answering,
    refused_result,
    service_name,
    tags_match,
)
from simbev_ros.ros.graph.scene_queue import OrderedScene, Phase, SceneOrder, SceneQueue

_STOPPED, _PLAYING, _PAUSED, _QUITTING, _NO_WORLD, _LOADING = range(6)
"""Numbers of simulation_interfaces/msg/SimulationState."""
_TIME, _STATE, _SPAWNED, _ALL = 1, 2, 4, 255
_WORDS = ("stopped", "playing", "paused", "quitting", "without a world", "loading a world")
_POLL_S, _ANSWER_S, _STEP_S = 0.01, 10.0, 120.0
_ACTION = "SimulateSteps"
_UNSUPPORTED = {"SPAWNING_RESOURCE_STRING", "WORLD_RESOURCE_STRING"}
_INFO = "simbev_ros; spawnables are models by name, worlds are towns by name or map files; poses are in the frame map"


class SimulationServices:
    """Answers the calls and runs goals, each in a thread of the node's executor.

    Args:
        node: The node that offers them.
        group: Callback group that lets several calls run at once.
        queue: Where ordered scenes go.
        scenario: The configuration whose map a loaded world replaces.
        recorded: Whether scenes are recorded, which therefore cannot start again.
    """

    def __init__(self, node: Any, group: Any, queue: SceneQueue, scenario: Scenario, *, recorded: bool) -> None:
        self._queue, self._scenario, self._recorded = queue, scenario, recorded
        self._changing, self._stepping = threading.Lock(), threading.Lock()
        self._started: OrderedScene | None = None
        self._types, self._messages = (import_module(f"simulation_interfaces.{kind}") for kind in ("srv", "msg"))
        for kind, act in {
            "GetSimulatorFeatures": self._get_features,
            "GetSimulationState": self._get_state,
            "SetSimulationState": _alone(self._set_state, self._changing),
            "StepSimulation": _alone(self._step, self._stepping),
            "ResetSimulation": _alone(self._reset, self._changing),
            "GetAvailableWorlds": self._get_worlds,
            "GetCurrentWorld": self._get_world,
            "LoadWorld": _alone(self._load, self._changing),
            "UnloadWorld": _alone(self._unload, self._changing),
        }.items():
            node.create_service(getattr(self._types, kind), service_name(kind), answering(act), callback_group=group)

        def client(kind: Any, name: str) -> Any:
            return node.create_client(kind, name, callback_group=group)

        self._pause, self._world_step = client(SetBool, "/world/pause"), client(Trigger, "/world/step")
        self._status_client, self._deletion = client(Trigger, RUN_STATUS), client(Trigger, DELETE_SPAWNED)
        self._action_type = import_module("simulation_interfaces.action").SimulateSteps
        self._action = ActionServer(
            node,
            self._action_type,
            ros_name(service_name(_ACTION), node.graph_namespace),
            self._run_steps,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def close(self) -> None:
        """Withdraw the action."""
        self._action.destroy()

    # state

    def _get_features(self, _request: Any, response: Any) -> None:
        constants = {name: getattr(response.features, name) for name in dir(response.features) if name.isupper()}
        supported = {name: value for name, value in constants.items() if name not in _UNSUPPORTED}
        response.features.features = sorted(value for value in supported.values() if isinstance(value, int))
        response.features.custom_info = _INFO

    def _get_state(self, _request: Any, response: Any) -> None:
        response.state.state = self._state()

    def _set_state(self, request: Any, _response: Any) -> None:
        target, state = request.state.state, self._state()
        if target == state:
            raise Refused("ALREADY_IN_TARGET_STATE", f"the simulation is {_WORDS[state]} already")
        if target not in (_STOPPED, _PLAYING, _PAUSED, _QUITTING):
            raise Refused("INCORRECT_TRANSITION", f"state: is {target}; allowed: 0 to 3; worlds have other services")
        if target == _QUITTING:
            self._queue.quit()
            return
        if state in (_NO_WORLD, _LOADING):
            raise Refused("RESULT_INCORRECT_STATE", f"the simulation is {_WORDS[state]}")
        if target == _STOPPED:
            self._stop()
        elif self._queue.active is None:
            self._start_again("STATE_TRANSITION_ERROR", paused=target == _PAUSED)
        else:
            self._call(self._pause, SetBool.Request(data=target == _PAUSED))
        self._started = self._queue.active or self._started if target == _PAUSED else self._started

    def _state(self) -> int:
        """The state of the simulation."""
        if self._queue.is_quitting:
            return _QUITTING
        scene = self._queue.active
        if scene is None:
            return _NO_WORLD if self._queue.latest is None else _STOPPED
        if scene.phase in (Phase.WAITING, Phase.LOADING):
            return _LOADING
        status = self._status()
        if not status["running"]:  # its last files are being written
            with suppress(FutureTimeoutError):
                scene.outcome.result(_ANSWER_S)
            return _STOPPED
        if not status["paused"]:
            return _PLAYING
        return _STOPPED if status["next_tick"] == status["first_tick"] and scene is not self._started else _PAUSED

    def _stop(self) -> None:
        """End the scene and load it again, to wait before its first tick; a recorded one ends for good."""
        if self._recorded:
            self._end("the simulation was stopped")
        else:
            self._start_again("STATE_TRANSITION_ERROR", paused=True)

    def _end(self, reason: str) -> None:
        scene = self._queue.active
        self._queue.end_all(reason)
        if scene is not None:
            scene.outcome.result()

    def _start_again(self, code: str, *, paused: bool) -> None:
        """Play the latest scene from its start, in place of the current one."""
        if self._recorded:
            raise Refused(code, "a scene that is recorded cannot start again; load a world")
        scene = self._queue.latest
        if scene is None:
            raise Refused(code, "no scene has been loaded yet")
        self._await_loaded(self._queue.repeat(scene, paused=paused), code)

    def _await_loaded(self, scene: OrderedScene, code: str) -> None:
        while scene.phase in (Phase.WAITING, Phase.LOADING):
            with suppress(FutureTimeoutError):
                if not (outcome := scene.outcome.result(_POLL_S)).success:
                    raise Refused(code, outcome.message)
                return

    # steps

    def _step(self, request: Any, _response: Any) -> None:
        scene = self._paused_scene()
        for _ in range(request.steps):
            self._step_once(scene)

    def _paused_scene(self) -> OrderedScene | None:
        if (state := self._state()) != _PAUSED:
            raise Refused("RESULT_OPERATION_FAILED", f"the simulation is {_WORDS[state]}; pause it first")
        return self._queue.active

    def _step_once(self, scene: OrderedScene | None) -> None:
        """Simulate one tick of a scene; returns when all nodes have finished it."""
        tick = self._status().get("next_tick")
        if tick is None or self._queue.active is not scene:
            raise Refused("RESULT_OPERATION_FAILED", "the scene has ended")
        if not (answer := self._call(self._world_step, Trigger.Request())).success:
            raise Refused("RESULT_OPERATION_FAILED", answer.message)
        end_s = time.monotonic() + _STEP_S
        while (status := self._status())["running"] and status["finished_tick"] < tick:
            if time.monotonic() > end_s:
                raise Refused("RESULT_OPERATION_FAILED", f"tick {tick} is not finished within {_STEP_S:g} s")
            time.sleep(_POLL_S)

    def _run_steps(self, goal: ServerGoalHandle) -> Any:
        kind, steps, done = self._action_type, goal.request.steps, 0
        outcome = kind.Result()
        outcome.result.result = outcome.result.RESULT_OK
        try:
            with self._stepping, foreign_content("goal"):
                scene = self._paused_scene()
                while done < steps and not goal.is_cancel_requested:
                    self._step_once(scene)
                    done += 1
                    goal.publish_feedback(kind.Feedback(completed_steps=done, remaining_steps=steps - done))
        except SimbevError as error:
            refused_result(outcome.result, outcome, error)
            goal.abort()
            return outcome
        if done < steps:
            outcome.result.result = outcome.result.RESULT_OPERATION_FAILED
            outcome.result.error_message = f"its goal was canceled after {done} steps"
            goal.canceled()
        else:
            goal.succeed()
        return outcome

    def _reset(self, request: Any, _response: Any) -> None:
        scope = request.scope or _ALL
        if self._queue.latest is None and self._queue.active is None:
            raise Refused("RESULT_INCORRECT_STATE", "no scene has been loaded yet")
        if scope & (_TIME | _STATE) and not scope & _SPAWNED:
            raise Refused("RESULT_FEATURE_UNSUPPORTED", "scope: spawned entities go with a new start; add 4 to it")
        if scope & (_TIME | _STATE):
            state = self._state()
            self._start_again("RESULT_OPERATION_FAILED", paused=state != _PLAYING)
            self._started = self._queue.active or self._started if state == _PAUSED else self._started
        elif scope & _SPAWNED and self._queue.active is not None:
            self._call(self._deletion, Trigger.Request())

    # worlds

    def _get_worlds(self, request: Any, response: Any) -> None:
        if request.additional_sources and not request.continue_on_error:
            raise Refused("RESULT_NOT_FOUND", "additional_sources: are not searched; LoadWorld takes map files by path")
        own = [entry.map for entry in self._scenario.scenes if suffix_of(entry.map)]
        worlds = [self._world(uri) for uri in dict.fromkeys([*known_maps(), *own])]
        response.worlds = [world for world in worlds if tags_match(world.tags, request.filter)]

    def _world(self, uri: str) -> Any:
        """WorldResource of a town or a map file."""
        kind, words = ("file", "map file") if suffix_of(uri) else ("town", "built-in town")
        name = Path(uri).name.removesuffix(suffix_of(uri)) if suffix_of(uri) else uri
        world = self._messages.WorldResource(name=name, description=f"{words} {name}", tags=["outdoor", kind])
        world.world_resource.uri = uri
        return world

    def _get_world(self, _request: Any, response: Any) -> None:
        if (scene := self._queue.active or self._queue.latest) is None:
            raise Refused("NO_WORLD_LOADED", "no world is loaded")
        response.world = self._world(scene.spec.map.path or scene.spec.map.name)

    def _load(self, request: Any, response: Any) -> None:
        uri = request.world_resource.uri.removeprefix("file://")
        if not uri:
            code = "RESULT_FEATURE_UNSUPPORTED" if request.world_resource.resource_string else "NO_RESOURCE"
            raise Refused(code, "world_resource: has no URI; strings are not supported")
        if request.fail_on_unsupported_element:
            raise Refused("RESULT_FEATURE_UNSUPPORTED", "fail_on_unsupported_element: simbev map lists such elements")
        if not suffix_of(uri) and uri not in known_maps():
            code = "UNSUPPORTED_FORMAT" if Path(uri).suffix else "RESULT_NOT_FOUND"
            raise Refused(code, f"world_resource: {uri!r:.80} is neither a town nor a map file that is read")
        configuration = parse_yaml(self._scenario.as_yaml())
        configuration["scenes"] = [{"map": uri, "train": 1}]
        try:
            scene = self._queue.order(SceneOrder(json.dumps(configuration)), interrupt=True, paused=True)
        except InputError as error:
            raise Refused("RESOURCE_PARSE_ERROR", str(error)) from None
        self._await_loaded(scene, "RESULT_OPERATION_FAILED")
        response.world = self._world(uri)

    def _unload(self, _request: Any, _response: Any) -> None:
        if self._state() == _NO_WORLD:
            raise Refused("NO_WORLD_LOADED", "no world is loaded")
        self._end("its world was unloaded")
        self._queue.latest = None

    # the world node

    def _status(self) -> dict[str, Any]:
        """Status of the world's run, as in ``run_status``."""
        status: dict[str, Any] = json.loads(self._call(self._status_client, Trigger.Request()).message)
        return status

    def _call(self, client: Any, request: Any) -> Any:
        """Call a service of the world node; return the answer."""
        answered, is_there = threading.Event(), client.wait_for_service(_ANSWER_S)
        future = client.call_async(request)
        future.add_done_callback(lambda _: answered.set())
        if not is_there or not answered.wait(_ANSWER_S):
            client.remove_pending_request(future)
            raise SimbevError("the world node does not answer")
        return future.result()


def _alone(act: Act, lock: threading.Lock) -> Act:
    """Let one call at a time act; a state can be set while steps are taken."""

    def act_alone(request: Any, response: Any) -> None:
        with lock:
            act(request, response)

    return act_alone
