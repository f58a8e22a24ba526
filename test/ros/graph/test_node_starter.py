"""Forked node processes have an output, a session and an exit code of their own, and end with their parent."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import psutil
import pytest
from ros_domain import DOMAIN
from waiting import PATIENCE_S, wait_until

from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.node_starter import ForkedProcess, NodeStarter
from simbev_ros.ros.graph.shared_memory import middleware_files, remove_orphans
from simbev_ros.ros.msgs.signing import KEY_VARIABLE

pytestmark = pytest.mark.graph

SUPERVISOR = """
import sys, time
from pathlib import Path
from simbev_ros.ros.graph.environment import graph_environment
from simbev_ros.ros.graph.node_starter import NodeStarter
folder = Path(sys.argv[1])
starter = NodeStarter(["imu", "gnss"], folder, graph_environment(int(sys.argv[2])))
nodes = [starter.start([f"{kind}:{kind}"], folder / f"{kind}.log") for kind in ("imu", "gnss")]
print(*(node.await_start() for node in nodes), flush=True)
time.sleep(600)
"""


@pytest.fixture(autouse=True)
def shared_memory_of_killed_nodes() -> Iterator[None]:
    """Remove what killed processes leave; a session does so itself."""
    before = set(middleware_files())
    yield
    remove_orphans(set(middleware_files()) - before)


@pytest.fixture
def starter(tmp_path: Path) -> Iterator[NodeStarter]:
    started = NodeStarter(["imu"], tmp_path, graph_environment(DOMAIN))
    yield started
    started.close()


def running(starter: NodeStarter, folder: Path) -> tuple[ForkedProcess, psutil.Process]:
    """A node that is ready for signals, and what the system says of it."""
    process = starter.start(["imu:mine"], folder / "mine.log")
    seen = psutil.Process(process.await_start())
    wait_until(lambda: "mine" in seen.name())
    wait_until(lambda: seen.num_threads() > 5)  # the middleware runs
    return process, seen


def test_a_node_has_a_session_and_a_name_of_its_own_and_ends_in_order(starter: NodeStarter, tmp_path: Path) -> None:
    process, seen = running(starter, tmp_path)
    assert os.getsid(seen.pid) == seen.pid == process.pid
    assert seen.cmdline()[0].startswith("simbev_ros.ros.nodes.main imu:mine")
    assert process.poll() is None
    with pytest.raises(subprocess.TimeoutExpired):
        process.wait(0.1)
    process.send_signal(signal.SIGTERM)
    assert process.wait(PATIENCE_S) == 0 == process.poll()
    process.send_signal(signal.SIGTERM)  # nobody is left


def test_exit_code_and_output_are_those_of_the_process(starter: NodeStarter, tmp_path: Path) -> None:
    refused = starter.start(["x:x"], tmp_path / "x.log")
    killed, seen = running(starter, tmp_path)
    seen.kill()
    assert (refused.wait(PATIENCE_S), killed.wait(PATIENCE_S)) == (2, -signal.SIGKILL)
    assert (tmp_path / "x.log").read_text().startswith("error: there is no node kind 'x'")
    assert starter.failure() is None


def test_all_nodes_end_when_the_server_is_killed_even_a_stopped_one(starter: NodeStarter, tmp_path: Path) -> None:
    process, seen = running(starter, tmp_path)
    server = seen.parent()
    assert server is not None
    seen.suspend()
    server.kill()
    assert process.wait(PATIENCE_S) == -signal.SIGKILL
    assert starter.failure() == "the process that starts nodes died: killed by SIGKILL"
    wait_until(lambda: not psutil.pid_exists(seen.pid))  # until its new parent has noticed


def test_a_server_whose_imports_fail_says_why(tmp_path: Path) -> None:
    starter = NodeStarter(["sonar"], tmp_path, graph_environment(DOMAIN))
    assert starter.start(["sonar:sonar"], tmp_path / "sonar.log").await_start() == 0
    assert str(starter.failure()).endswith("ModuleNotFoundError: No module named 'simbev_ros.ros.nodes.sonar_node'")
    starter.close()


@pytest.mark.parametrize("stopped", ["node", "server"])
def test_nodes_end_with_a_killed_supervisor_even_if_something_is_stopped(tmp_path: Path, stopped: str) -> None:
    command = [sys.executable, "-c", SUPERVISOR, str(tmp_path), str(DOMAIN)]
    supervisor = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert supervisor.stdout is not None
    nodes = [psutil.Process(int(word)) for word in supervisor.stdout.readline().split()]
    server = nodes[0].parent()
    assert server is not None and len(nodes) == 2
    (nodes[0] if stopped == "node" else server).suspend()
    supervisor.kill()
    supervisor.communicate()
    gone, _ = psutil.wait_procs([server, *nodes], timeout=PATIENCE_S)
    assert len(gone) == 3


STOPPED_SERVER = """#!{python}
import os, signal, sys

class Stop:
    def find_spec(self, name, path, target=None):
        if name == "{stop_at}":
            os.kill(os.getpid(), signal.SIGSTOP)

sys.meta_path.insert(0, Stop())
sys.argv = sys.argv[4:]
from simbev_ros.ros.nodes import fork_server
fork_server.main()
"""
SUPERVISOR_OF_ONE = """
import sys, time
from pathlib import Path
from simbev_ros.ros.graph.node_starter import NodeStarter
sys.executable = sys.argv[1]
print(NodeStarter(["imu"], Path(sys.argv[1]).parent, {}).pid, flush=True)
time.sleep(600)
"""


@pytest.mark.parametrize(
    "stop_at",
    ["simbev_ros", "simbev_ros.ros.nodes.main", "simbev_ros.ros.nodes.imu_node"],
    ids=["start", "main", "kind"],
)
def test_a_server_that_is_stopped_while_it_imports_ends_with_a_killed_supervisor(tmp_path: Path, stop_at: str) -> None:
    program = tmp_path / "stopped_server"
    program.write_text(STOPPED_SERVER.format(python=sys.executable, stop_at=stop_at))
    program.chmod(0o700)
    command = [sys.executable, "-c", SUPERVISOR_OF_ONE, str(program)]
    supervisor = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, start_new_session=True)
    assert supervisor.stdout is not None
    server = psutil.Process(int(supervisor.stdout.readline()))
    wait_until(lambda: server.status() == psutil.STATUS_STOPPED)
    supervisor.kill()
    supervisor.communicate()
    gone, _ = psutil.wait_procs([server], timeout=PATIENCE_S)
    assert gone


PATIENT_SERVER = """#!{python}
import faulthandler, signal, sys
from simbev_ros.ros.nodes import fork_server
faulthandler.register(signal.SIGUSR2)
fork_server._STOP_TIMEOUT_S = 1e6
sys.argv = sys.argv[4:]
fork_server.main()
"""


def test_nodes_end_in_order_that_were_requested_just_before_the_supervisor_died(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    program = tmp_path / "patient_server"  # it does not kill nodes that have missed the signal
    program.write_text(PATIENT_SERVER.format(python=sys.executable))
    program.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(program))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(sys.path))
    starter = NodeStarter(["imu"], tmp_path, graph_environment(DOMAIN))
    server = psutil.Process(starter.pid)
    try:
        running(starter, tmp_path)
        server.suspend()
        for index in range(6):
            starter.start([f"imu:imu_{index}"], tmp_path / f"{index}.log")
        starter._channel.close()
        server.resume()
        gone, _ = psutil.wait_procs([server], PATIENCE_S)
        assert gone, stacks(server.children(), tmp_path)
    finally:
        for process in (*server.children(), server) if server.is_running() else ():
            process.kill()
        starter.close()


def stacks(nodes: list[psutil.Process], folder: Path) -> str:
    """Where nodes hang that do not end, and all else that is in the logs of their folder."""
    for node in nodes:
        node.send_signal(signal.SIGUSR2)
    logs = list(folder.glob("*.log"))
    with suppress(AssertionError):
        wait_until(lambda: sum("most recent call first" in log.read_text() for log in logs) >= len(nodes), 10)
    return "\n".join(f"{log.name}:\n{log.read_text()}" for log in logs)


def test_a_command_does_not_know_the_key_and_ends_with_all_that_it_has_started(tmp_path: Path) -> None:
    variables = {**graph_environment(DOMAIN), KEY_VARIABLE: "key"}
    starter, log = NodeStarter([], tmp_path, variables), tmp_path / "stack.log"
    script = f"echo ${KEY_VARIABLE} $ROS_DOMAIN_ID; sleep 1000 & sleep 1000"
    leader = psutil.Process(starter.start(["sh", "-c", script], log, is_command=True).await_start())
    wait_until(lambda: len(leader.children()) == 2)
    everything = [leader, *leader.children()]
    leader.suspend()
    starter.close()
    gone, _ = psutil.wait_procs(everything, timeout=PATIENCE_S)
    assert len(gone) == 3
    assert log.read_text().split() == [str(DOMAIN)]


def test_a_command_that_cannot_run_ends_at_once(starter: NodeStarter, tmp_path: Path) -> None:
    (tmp_path / "stack").write_text("no program")
    (tmp_path / "stack").chmod(0o755)
    process = starter.start([str(tmp_path / "stack")], tmp_path / "stack.log", is_command=True)
    assert process.wait(PATIENCE_S) == os.EX_OSERR
    assert (tmp_path / "stack.log").read_text() == f"{tmp_path}/stack: Exec format error\n"


SERVER = """
import os, socket
from simbev_ros.ros.nodes.fork_server import _ForkServer
ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
server, (reading, writing) = _ForkServer(theirs), os.pipe()
if not (stray := os.fork()):
    os._exit(3)
if not (node := os.fork()):
    os.close(writing)
    os.read(reading, 1)
    os._exit(4)
server._running.add(node)
os.waitid(os.P_PID, stray, os.WEXITED | os.WNOWAIT)
server._report_ended()
os.close(writing)
while server._running:
    server._report_ended()
print(ours.recv(1000).decode().replace(str(node), "NODE"))
"""


def test_a_process_that_a_library_has_forked_is_not_taken_for_a_node() -> None:
    done = subprocess.run([sys.executable, "-c", SERVER], stdout=subprocess.PIPE, text=True, check=True)
    assert done.stdout == '{"ended": NODE, "exit_code": 4}\n'
