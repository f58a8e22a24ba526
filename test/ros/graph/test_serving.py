"""``simbev run --serve``: ROS nodes ask for scenes by service and action, follow and cancel them, and find the bags."""

import json
import signal
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from commands import Config, Simbev
from ros_domain import DOMAIN
from waiting import wait_until

from simbev_ros.foundation.files.limits import MAX_SCENE_NUMBER
from simbev_ros.recording.reader import SceneBag

pytest.importorskip("simbev_interfaces", reason="the messages of service and action are not installed")

pytestmark = pytest.mark.graph

_TIMEOUT_S = 90.0


class Client:
    """A node that asks for scenes.

    The executor's thread asks for actions: an answer that comes before rclpy has noted the question would be ignored.
    """

    def __init__(self, node: Any, executor: Any) -> None:
        from rclpy.action import ActionClient
        from simbev_interfaces.action import RunScene
        from simbev_interfaces.srv import LoadScene

        self._load_type, self._run_type, self._executor = LoadScene, RunScene, executor
        self._load = node.create_client(LoadScene, "/world/load_scene")
        self._run = ActionClient(node, RunScene, "/world/run_scene")
        self.feedback: list[Any] = []

    def wait(self) -> None:
        """Wait until the graph offers both."""
        assert self._load.wait_for_service(_TIMEOUT_S)
        assert self._run.wait_for_server(_TIMEOUT_S)

    def close(self) -> None:
        """Let go of the node, which would stay in the domain otherwise."""
        self._run.destroy()
        self._load.destroy()

    def load(self, **order: Any) -> Any:
        """Ask for a scene by service; return the answer."""
        return _result(self._load.call_async(self._load_type.Request(**order)))

    def start(self, **order: Any) -> Any:
        """Ask for a scene by action; return the handle of the goal."""
        goal = self._run_type.Goal(**order)
        return self.ask(lambda: self._run.send_goal_async(goal, lambda message: self.feedback.append(message.feedback)))

    def run(self, **order: Any) -> Any:
        """Run a scene by action; return the result."""
        return self.ask(self.start(**order).get_result_async)

    def ask(self, question: Callable[[], Any]) -> Any:
        """Ask a question about an action, which gives a future; return the answer."""
        return _result(_result(self._executor.create_task(question)))


def _result(future: Any) -> Any:
    done = threading.Event()
    future.add_done_callback(lambda _: done.set())
    assert done.wait(_TIMEOUT_S), "timed out"
    return future.result()


@pytest.fixture
def client() -> Iterator[Client]:
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    context = Context()
    rclpy.init(context=context, domain_id=DOMAIN)
    node = rclpy.create_node("client", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def spin() -> None:
        try:
            executor.spin()
        except ExternalShutdownException:
            return

    thread = threading.Thread(target=spin)
    thread.start()
    client = Client(node, executor)
    yield client
    executor.shutdown()
    thread.join()
    client.close()
    node.destroy_node()
    rclpy.shutdown(context=context)


@pytest.mark.slow
def test_scenes_are_played_recorded_and_ended_on_request(
    simbev: Simbev, small_config: Config, tmp_path: Path, client: Client
) -> None:
    from action_msgs.msg import GoalStatus

    config, dataset = small_config(0.5, without=("camera", "radar", "lidar")), tmp_path / "out"
    run = simbev("run", config, "--serve", "--record", dataset)
    client.wait()

    refused = client.load(number=-5)
    assert (refused.success, refused.message) == (False, f"number -5: must be 0 to {MAX_SCENE_NUMBER}")

    answer = client.run(number=3)
    assert answer.status == GoalStatus.STATUS_SUCCEEDED
    result = answer.result
    assert (result.success, result.scene, result.last_tick, result.reason) == (True, "Blocks-0003", 9, "duration")
    with SceneBag(Path(result.bag)) as bag:
        assert bag.custom_data["complete"] == "true"
        assert bag.spec is not None
        assert (bag.spec.number, bag.spec.seed) == (3, 14)
    assert {each.scene for each in client.feedback} == {"Blocks-0003"}
    assert {each.ticks for each in client.feedback} == {10}

    pids = run.nodes()
    longer = config.read_text().replace("duration_s: 0.5", "duration_s: 600")
    client.feedback.clear()
    goal = client.start(configuration=longer, number=4)
    wait_until(lambda: any(each.tick >= 3 for each in client.feedback))
    client.ask(goal.cancel_goal_async)
    canceled = client.ask(goal.get_result_async)
    assert canceled.status == GoalStatus.STATUS_CANCELED
    assert canceled.result.reason == "its goal was canceled"
    assert 3 <= canceled.result.last_tick < 12000
    with SceneBag(Path(canceled.result.bag)) as bag:
        assert bag.custom_data["complete"] == "true"
        assert bag.custom_data["ticks"] == str(canceled.result.last_tick + 1)
        assert b"duration_s: 600" in bag.attachments["config.yaml"]

    running = client.start(configuration=longer, number=5)
    loaded = client.load(seed=20)
    assert (loaded.success, loaded.scene) == (True, "Blocks-0006")
    ended = client.ask(running.get_result_async)
    assert ended.result.message + ended.result.reason == "Blocks-0006 was asked for instead"
    run.wait_for((dataset / "scenes" / "train" / "Blocks-0006").is_dir)
    assert run.nodes() == pids, "the graph was restarted"

    standing = config.read_text().replace("0.5", "30, end_after_standing_s: 0.4") + "ego: {driver: twist}\n"
    result = client.run(configuration=standing, number=7).result
    assert (result.success, result.reason) == (True, "ego stood still for 0.4 s at tick 7")
    with SceneBag(Path(result.bag)) as bag:
        facts = bag.custom_data
        assert (facts["complete"], facts["ticks"], facts["ended"]) == ("true", "8", result.reason)
        assert facts["expected"] == facts["recorded"] and json.loads(facts["expected"])["/world/actors"] == 8
        assert len(bag.topics["/ego/gnss/fix"].stamps_ns) == len(bag.topics["/ego/bev/labels"].stamps_ns) == 8
    assert run.nodes() == pids, "the graph was started again"

    run.process.send_signal(signal.SIGINT)
    code, output = run.finish()
    assert code == 130, output
    assert "Traceback" not in output
