"""The connection to a Ray cluster, and its nodes.

Ray is an extra. It is imported with the first connection.
"""

import os
import signal
import socket
import tempfile
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self, TypeVar

from simbev_ros.foundation.errors import InputError
from simbev_ros.foundation.installation.extras import load_extras

R = TypeVar("R")

_TOKEN_HINT = "; if it has a token, set RAY_AUTH_MODE=token and RAY_AUTH_TOKEN"
_CONNECT_TIMEOUT_S, _ANSWER_TIMEOUT_S, _REAP_TIMEOUT_S = 5.0, 120.0, 15.0


@dataclass(frozen=True, slots=True)
class Node:
    """A node of a cluster that is alive.

    Attributes:
        id: Ray's id of the node.
        address: Its IP address.
        cpus: Number of CPUs that it offers.
        memory_mib: Memory that it offers.
        gpus: Number of GPUs that it offers.
    """

    id: str
    address: str
    cpus: float
    memory_mib: float
    gpus: float

    @property
    def label(self) -> str:
        """Name of the node for messages."""
        return node_label(self.id, self.address)


def node_label(node_id: str, address: str) -> str:
    """Name of a node for messages; several nodes can have one address."""
    return f"node {node_id[:6]} at {address}"


def this_node() -> str:
    """Name of the node that this task or actor runs on, for messages."""
    import ray

    return node_label(ray.get_runtime_context().get_node_id(), ray.util.get_node_ip_address())


class RayCluster:
    """Connects to a running cluster; as a context manager it disconnects at the end.

    Args:
        address: ``auto``: the cluster that this machine is a node of; or ``HOST:PORT`` of the head.
        reaps_graphs: Whether to remove at the end what killed graphs have left on the nodes.

    Raises:
        InputError: Ray is not installed, there is no cluster at the address, or its version of Ray or Python differs.
    """

    def __init__(self, address: str, *, reaps_graphs: bool = True) -> None:
        load_extras()["cluster"].require("a cluster")
        head = _head_of(address)
        import ray

        try:
            with _kept_signals():
                context = ray.init(address=head, log_to_driver=False, logging_level="ERROR", namespace="simbev_ros")
        except (ConnectionError, RuntimeError, ValueError, ray.exceptions.RayError) as error:
            hint = _TOKEN_HINT if "Failed to connect" in str(error) else ""
            raise InputError(f"{address}: {one_line(error)}{hint}", parameter="ray") from None
        self.address = str(context.address_info["gcs_address"])
        self._reaps_graphs = reaps_graphs

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        import ray

        if self._reaps_graphs:
            self._reap_on_nodes()
        ray.shutdown()

    def nodes(self) -> list[Node]:
        """Nodes that are alive."""
        import ray

        return [
            Node(
                id=node["NodeID"],
                address=node["NodeManagerAddress"],
                cpus=node["Resources"].get("CPU", 0.0),
                memory_mib=node["Resources"].get("memory", 0.0) / 2**20,
                gpus=node["Resources"].get("GPU", 0.0),
            )
            for node in ray.nodes()
            if node["Alive"]
        ]

    def expected_speedup(self, cores: float) -> float:
        """Factor by which the cluster makes scenes faster than one graph, which keeps a number of cores busy."""
        return max(sum(node.cpus for node in self.nodes()) / cores, 1.0) if cores else 1.0

    def ask_nodes(self, function: Callable[..., R], *arguments: object) -> Iterator[tuple[Node, R]]:
        """Call a function on each node that has CPUs, without waiting for free ones; yield the answers.

        Nodes that are lost meanwhile have none.

        Args:
            function: Called on the nodes; of a module that they have.
            arguments: Its arguments.

        Raises:
            InputError: A node has not answered, or cannot run the function.
        """
        import ray

        asked = [(node, _on(node, function).remote(*arguments)) for node in self.nodes() if node.cpus]
        for node, answer in asked:
            try:
                yield node, ray.get(answer, timeout=_ANSWER_TIMEOUT_S)
            except ray.exceptions.GetTimeoutError:
                raise InputError(f"{node.label}: has not answered within {_ANSWER_TIMEOUT_S:g} s") from None
            except ray.exceptions.RayError as error:
                if node.id in {other.id for other in self.nodes()}:
                    raise InputError(f"{node.label}: cannot run this package: {one_line(error)}") from None

    def _reap_on_nodes(self) -> None:
        """Remove what killed graphs have left on the nodes; those that do not answer are left alone."""
        import ray

        with suppress(ray.exceptions.RayError):
            asked = [_on(node, _reap_on_node).remote() for node in self.nodes() if node.cpus]
            ray.wait(asked, num_returns=len(asked), timeout=_REAP_TIMEOUT_S)


def _on(node: Node, function: Any) -> Any:
    """A remote function that runs on a certain node and reserves no CPU."""
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    return ray.remote(
        num_cpus=0, max_retries=0, scheduling_strategy=NodeAffinitySchedulingStrategy(node.id, soft=False)
    )(function)


def _reap_on_node() -> None:
    """Runs on a node."""
    from simbev_ros.ros.graph.resources import reap_killed_graphs

    reap_killed_graphs()


def _head_of(address: str) -> str:
    """Address of a cluster's head; refuse one at which nothing listens, as Ray would try for minutes."""
    head = _own_cluster() if address == "auto" else address
    if head is None:
        raise InputError(
            "auto: this machine is not a node of a Ray cluster; start one with ray start --head, or name a head as "
            "HOST:PORT; workers on this machine need no cluster",
            parameter="ray",
        )
    host, _, port = head.rpartition(":")
    if not (host and port.isascii() and port.isdecimal() and 0 < int(port[:6]) < 1 << 16) or "/" in host:
        raise InputError(
            f"is {head!r:.80}; allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379", parameter="ray"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_TIMEOUT_S).close()
    except OSError as error:
        problem = f"{address}: nothing answers at {head}: {error.strerror or error}"
        raise InputError(problem, parameter="ray") from None
    return head


def _own_cluster() -> str | None:
    """Address of the head of the cluster that this machine is a node of, as Ray notes it; None: of none."""
    noted = Path(os.environ.get("RAY_TMPDIR", tempfile.gettempdir())) / "ray" / "ray_current_cluster"
    with suppress(OSError):
        return os.environ.get("RAY_ADDRESS") or noted.read_text().strip() or None
    return None


@contextmanager
def _kept_signals() -> Iterator[None]:
    """Keep the handlers of signals, which Ray replaces."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def one_line(error: Exception) -> str:
    """The lines of a message of Ray, without its indentation and the advice after the first paragraph."""
    lines = str(error).strip().split("\n\n")[0].splitlines()
    return " ".join(line.strip() for line in lines)


def largest(nodes: Sequence[Node]) -> str:
    """The largest memory of some nodes, for messages."""
    return f"{max((node.memory_mib for node in nodes), default=0.0) / 1024:.1f} GiB"
