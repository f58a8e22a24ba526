"""A Ray cluster with a token on this machine, whose nodes a test can kill; each node is a raylet with its processes."""

import os
from contextlib import suppress
from typing import Any

import psutil
from ray._private.authentication_test_utils import reset_auth_token_state
from ray.cluster_utils import Cluster


class RayNodes:
    """Starts a head and further nodes, and ends them with all their processes.

    Args:
        nodes: Number of nodes, with the head.
        cpus: CPUs that each node says that it has.
        memory_mib: Memory that each node says that it has.
    """

    def __init__(self, nodes: int, cpus: int = 2, memory_mib: int = 6144) -> None:
        os.environ |= {"RAY_USAGE_STATS_ENABLED": "0", "RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": "of-the-tests-" * 3}
        reset_auth_token_state()  # Ray has read the environment when it was imported
        self._offers = {"num_cpus": cpus, "memory": memory_mib << 20, "object_store_memory": 100 << 20}
        self._cluster = Cluster(initialize_head=True, head_node_args={**self._offers, "include_dashboard": False})
        self.others: list[Any] = []
        self._stopped: list[psutil.Process] = []
        for _ in range(nodes - 1):
            self.add()

    @property
    def address(self) -> str:
        """Address of the head."""
        return str(self._cluster.address)

    def add(self) -> None:
        """Start another node."""
        self.others.append(self._cluster.add_node(wait=False, **self._offers))

    def kill_raylet(self, index: int) -> None:
        """Kill the raylet of a node that is not the head, as when the machine fails."""
        self._cluster.remove_node(self.others.pop(index), allow_graceful=False)

    def stop(self, index: int) -> None:
        """Stop all processes of a node that is not the head, as when the machine hangs."""
        raylet = psutil.Process(self.others.pop(index).all_processes["raylet"][0].process.pid)
        self._stopped = [raylet, *raylet.children(recursive=True)]
        for process in self._stopped:
            with suppress(psutil.NoSuchProcess):
                process.suspend()

    def resume(self) -> None:
        """Let the processes of the node that was stopped last go on."""
        for process in self._stopped:
            with suppress(psutil.NoSuchProcess):
                process.resume()

    def close(self) -> None:
        """End all nodes."""
        self.resume()
        self._cluster.shutdown()
