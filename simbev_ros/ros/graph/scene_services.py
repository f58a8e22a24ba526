"""Service and action with which ROS nodes order scenes from a running graph: /world/load_scene and /world/run_scene."""

import threading
import time
from collections.abc import Iterator
from concurrent.futures import TimeoutError as FutureTimeoutError
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

import rclpy
from rclpy.action.server import ActionServer, CancelResponse, GoalResponse, ServerGoalHandle
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.executors import ExternalShutdownException, MultiThreadedExecutor
from rclpy.signals import SignalHandlerOptions

from simbev_ros.config.scenario import Scenario
from simbev_ros.foundation.errors import InputError, SimbevError, foreign_content
from simbev_ros.foundation.installation.message_packages.installer import describe_remedy
from simbev_ros.ros.conventions.arguments import PLAIN, RosArguments
from simbev_ros.ros.conventions.names import NamespacedNode, NodeName, ros_name
from simbev_ros.ros.conventions.simulation_interfaces import has_simulation_interfaces
from simbev_ros.ros.graph.scene_queue import OrderedScene, Outcome, Phase, SceneOrder, SceneQueue
from simbev_ros.ros.graph.simulation_services import SimulationServices

LOAD_SCENE, RUN_SCENE = "/world/load_scene", "/world/run_scene"
_NODE = "scenes"
_FEEDBACK_S = 0.2
_MIN_RATE_S = 0.5
_MAX_GOALS = 64
"""Number of goals that are followed at the same time, each by a thread; further ones are rejected."""
_THREADS = _MAX_GOALS + 8


def require_interfaces() -> None:
    """Fail if the messages of service and action are not installed.

    Raises:
        InputError: They are not; the message says how to get them.
    """
    try:
        import_module("simbev_interfaces.action")
    except ImportError:
        remedy = describe_remedy() or "build the package in interfaces/ with colcon, and source it"
        raise InputError(f"the package simbev_interfaces is not installed: {remedy}") from None


@contextmanager
def scene_services(
    queue: SceneQueue, scenario: Scenario, domain: int, ros: RosArguments = PLAIN, *, recorded: bool = False
) -> Iterator[None]:
    """Offer service and action, and those of simulation_interfaces, for as long as the context is open.

    Args:
        queue: Where ordered scenes go.
        scenario: The configuration of the graph.
        domain: ROS domain of the graph.
        ros: ROS arguments of all nodes of the graph.
        recorded: Whether scenes are recorded.
    """
    context = Context()
    no_handlers = SignalHandlerOptions.NO
    rclpy.init(args=ros.for_nodes, context=context, domain_id=domain, signal_handler_options=no_handlers)
    node = NamespacedNode(NodeName(_NODE, graph=ros.namespace), context=context)
    servers: list[Any] = [_SceneServer(node, queue)]
    if has_simulation_interfaces():
        servers.append(SimulationServices(node, ReentrantCallbackGroup(), queue, scenario, recorded=recorded))
    executor = MultiThreadedExecutor(_THREADS, context=context)
    executor.add_node(node)

    def spin() -> None:
        with suppress(ExternalShutdownException):
            executor.spin()

    thread = threading.Thread(target=spin, name="scene services")
    thread.start()
    try:
        yield
    finally:
        queue.close()  # ends the callbacks that wait for a scene
        for server in servers:
            server.close()
        executor.shutdown()
        thread.join()
        node.destroy_node()
        rclpy.shutdown(context=context)


class _SceneServer:
    """Answers service calls and runs goals, each in a thread of the executor."""

    def __init__(self, node: Any, queue: SceneQueue) -> None:
        from simbev_interfaces.action import RunScene
        from simbev_interfaces.srv import LoadScene

        self._queue, self._run_scene = queue, RunScene
        self._free_goals = threading.BoundedSemaphore(_MAX_GOALS)
        group = ReentrantCallbackGroup()
        node.create_service(LoadScene, LOAD_SCENE, self._load, callback_group=group)
        self._action = ActionServer(
            node,
            RunScene,
            ros_name(RUN_SCENE, node.graph_namespace),
            self._run,
            goal_callback=self._admit,
            cancel_callback=lambda _: CancelResponse.ACCEPT,
            callback_group=group,
        )

    def close(self) -> None:
        """Withdraw the action."""
        self._action.destroy()

    def _admit(self, _: Any) -> GoalResponse:
        return GoalResponse.ACCEPT if self._free_goals.acquire(blocking=False) else GoalResponse.REJECT

    def _load(self, request: Any, response: Any) -> Any:
        try:
            scene = self._order(request, interrupt=request.interrupt)
        except SimbevError as error:
            response.success, response.message = False, str(error)
        else:
            response.success, response.scene = True, scene.spec.name
        return response

    def _order(self, request: Any, *, interrupt: bool) -> OrderedScene:
        """Draw a scene and add it to the queue. Raises SimbevError, whatever the order holds."""
        with foreign_content("order"):
            return self._queue.order(_order_of(request), interrupt=interrupt)

    def _run(self, goal: ServerGoalHandle) -> Any:
        try:
            return self._run_goal(goal)
        finally:
            self._free_goals.release()

    def _run_goal(self, goal: ServerGoalHandle) -> Any:
        try:
            scene = self._order(goal.request, interrupt=False)
        except SimbevError as error:
            goal.abort()
            return self._run_scene.Result(success=False, message=str(error), last_tick=-1)
        outcome = self._follow(goal, scene)
        if scene.stop_reason is not None and goal.is_cancel_requested:
            goal.canceled()
        elif outcome.success:
            goal.succeed()
        else:
            goal.abort()
        return self._run_scene.Result(scene=scene.spec.name, **outcome._asdict())

    def _follow(self, goal: ServerGoalHandle, scene: OrderedScene) -> Outcome:
        """Send feedback until the scene has ended."""
        meter: _RateMeter | None = None
        while True:
            with suppress(FutureTimeoutError):
                return scene.outcome.result(_FEEDBACK_S)
            if goal.is_cancel_requested:
                scene.stop("its goal was canceled")
            if meter is None and scene.phase is Phase.PLAYING:
                meter = _RateMeter(scene.tick)
            goal.publish_feedback(
                self._run_scene.Feedback(
                    phase=int(scene.phase),
                    scene=scene.spec.name,
                    tick=scene.tick,
                    ticks=scene.spec.ticks,
                    rate_hz=0.0 if meter is None else meter.rate_hz(scene.tick),
                )
            )


class _RateMeter:
    """Measures ticks per second of wall time, over at least half a second."""

    def __init__(self, tick: int) -> None:
        self._since_s, self._tick, self._rate_hz = time.monotonic(), tick, 0.0

    def rate_hz(self, tick: int) -> float:
        elapsed_s = time.monotonic() - self._since_s
        if elapsed_s >= _MIN_RATE_S:
            self._rate_hz = (tick - self._tick) / elapsed_s
            self._since_s, self._tick = time.monotonic(), tick
        return self._rate_hz


def _order_of(request: Any) -> SceneOrder:
    """The order in a request or a goal, where -1 means as configured."""

    def chosen(value: int) -> int | None:
        return None if value == request.AS_CONFIGURED else value

    return SceneOrder(request.configuration, chosen(request.seed), chosen(request.number))
