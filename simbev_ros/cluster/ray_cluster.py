"""The connection to a Ray cluster: its nodes, and whether they give the same results as this machine.

Ray is an extra. It is imported with the first connection.
"""

import importlib
import os
import secrets
import signal
import socket
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, Self

from simbev_ros import __version__
from simbev_ros.cache.fingerprint import fingerprint_inputs
from simbev_ros.errors import InputError
from simbev_ros.recording.whole_files import nearest_existing, write_errors

_CONNECT_TIMEOUT_S, _CHECK_TIMEOUT_S, _SWEEP_TIMEOUT_S = 5.0, 120.0, 15.0


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


@dataclass(frozen=True, slots=True)
class _NodeReport:
    """What a node says about itself.

    Attributes:
        version: Version of this package there.
        code: What decides about the results (``fingerprint_inputs``).
        problem: Why it cannot use a shared folder or file; None: it can use all of them.
    """

    version: str
    code: dict[str, bytes]
    problem: str | None


@dataclass(frozen=True, slots=True)
class _Sample:
    """A bag's file by which a node shows that it sees what this machine reads.

    Attributes:
        shared: Folder or file that all nodes must see.
        file: The sample, in the folder.
        size: Its size in bytes.
    """

    shared: str
    file: str
    size: int

    @classmethod
    def of(cls, shared: Path) -> Self:
        """Choose a sample; of a folder without bags, the folder itself."""
        shared = shared.absolute()
        file = next(shared.rglob("*.mcap"), shared)
        return cls(str(shared), str(file), file.stat().st_size if file.is_file() else 0)

    def problem(self) -> str | None:
        """Runs on a node: why it does not see the sample; None: it does."""
        file = Path(self.file)
        if file.exists() and (not file.is_file() or file.stat().st_size == self.size):
            return None
        return f"does not see {self.shared} as this machine does; all nodes must see it"


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
        sweeps_graphs: Whether to remove at the end what killed graphs have left on the nodes.

    Raises:
        InputError: Ray is not installed, there is no cluster at the address, or its version of Ray or Python differs.
    """

    def __init__(self, address: str, *, sweeps_graphs: bool = True) -> None:
        if find_spec("ray") is None:
            raise InputError(f"--ray needs Ray; install it: {sys.executable} -m pip install 'ray[default]'")
        head = _head_of(address)
        import ray

        try:
            with _kept_signals():
                context = ray.init(address=head, log_to_driver=False, logging_level="ERROR", namespace="simbev_ros")
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise InputError(f"--ray {address}: {one_line(error)}") from None
        self.address = str(context.address_info["gcs_address"])
        self._sweeps_graphs = sweeps_graphs

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        import ray

        if self._sweeps_graphs:
            self._sweep_nodes()
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

    def check_nodes(self, *folders: Path, reads: Sequence[Path] = (), modules: Sequence[str] = ()) -> None:
        """Check that each node that has CPUs runs the same code and can use the shared folders.

        Args:
            folders: The folders that all nodes write to; of those that do not exist yet, the nearest ones above.
            reads: Datasets and bags that exist, and that all nodes read.
            modules: Names of the modules whose code matters; none: those that make scenes.

        Raises:
            InputError: One of them does not; the message names it.
        """
        import ray

        nodes = [node for node in self.nodes() if node.cpus]
        with ExitStack() as held:
            probes = [str(held.enter_context(_probe(folder))) for folder in folders]
            question = (probes, [*map(_Sample.of, reads)], tuple(modules))
            asked = [_on(node, _describe_node).remote(*question) for node in nodes]
            for node, report in zip(nodes, asked, strict=True):
                try:
                    _require_same(node, tuple(modules), ray.get(report, timeout=_CHECK_TIMEOUT_S))
                except ray.exceptions.GetTimeoutError:
                    raise InputError(f"{node.label}: has not answered within {_CHECK_TIMEOUT_S:g} s") from None
                except ray.exceptions.RayError as error:
                    raise InputError(f"{node.label}: cannot run this package: {one_line(error)}") from None

    def _sweep_nodes(self) -> None:
        """Remove what killed graphs have left on the nodes; those that do not answer are left alone."""
        import ray

        with suppress(ray.exceptions.RayError):
            asked = [_on(node, _sweep_node).remote() for node in self.nodes() if node.cpus]
            ray.wait(asked, num_returns=len(asked), timeout=_SWEEP_TIMEOUT_S)


def _on(node: Node, function: Any) -> Any:
    """A remote function that runs on a certain node, beside whatever else runs there."""
    import ray
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

    return ray.remote(
        num_cpus=0, max_retries=0, scheduling_strategy=NodeAffinitySchedulingStrategy(node.id, soft=False)
    )(function)


def _describe_node(probes: Sequence[str], samples: Sequence[_Sample], modules: tuple[str, ...]) -> _NodeReport:
    """Runs on a node."""
    problems = [*(_folder_problem(Path(probe)) for probe in probes), *(sample.problem() for sample in samples)]
    return _NodeReport(__version__, _code(modules), next(filter(None, problems), None))


def _sweep_node() -> None:
    """Runs on a node."""
    from simbev_ros.graph.traces import sweep

    sweep()


def _folder_problem(probe: Path) -> str | None:
    """Why a node cannot use the folder of a probe, a file that the driver has made there; None: it can."""
    if not probe.is_file():
        return f"does not see the folder {probe.parent}; --out must be a folder that all nodes see"
    return None if os.access(probe.parent, os.W_OK) else f"cannot write to {probe.parent}"


@contextmanager
def _probe(folder: Path) -> Iterator[Path]:
    """Make a file in a folder for as long as the context is open."""
    path = nearest_existing(folder.absolute()) / f".probe-{secrets.token_hex(4)}"
    with write_errors(folder):
        path.touch()
    try:
        yield path
    finally:
        path.unlink(missing_ok=True)


@cache
def _code(modules: tuple[str, ...]) -> dict[str, bytes]:
    """All code on this machine that decides about the results of modules, or without any about the bytes of a scene."""
    if modules:
        return fingerprint_inputs(*modules)
    nodes = importlib.import_module("simbev_ros.nodes.main").KINDS  # loads ROS
    return fingerprint_inputs("simbev_ros.production.scene_maker", *(f"simbev_ros.nodes.{kind}_node" for kind in nodes))


def _require_same(node: Node, modules: tuple[str, ...], report: _NodeReport) -> None:
    """Refuse a node that would give other results, or that cannot use what is shared."""
    if report.version != __version__:
        raise InputError(f"{node.label}: has simbev_ros {report.version}, this machine {__version__}")
    here = _code(modules)
    if differing := sorted(
        name for name in here.keys() | report.code.keys() if here.get(name) != report.code.get(name)
    ):
        raise InputError(
            f"{node.label}: {_describe_difference(differing[0], here, report.code)}; all nodes need the same code"
        )
    if report.problem is not None:
        raise InputError(f"{node.label}: {report.problem}")


def _describe_difference(name: str, here_code: dict[str, bytes], code: dict[str, bytes]) -> str:
    """How a part of the code differs on a node."""
    there, here = code.get(name), here_code.get(name)
    if name.startswith(("module ", "data ")):
        return f"{name} differs" if there and here else f"{name} is {'not there' if here else 'not here'}"
    versions = ("not at all" if version is None else version.decode() for version in (there, here))
    return f"has {name} {', this machine '.join(versions)}"


def _head_of(address: str) -> str:
    """Address of a cluster's head; refuse one at which nothing listens, as Ray would try for minutes."""
    name, head = f"--ray {address}", _own_cluster() if address == "auto" else address
    if head is None:
        raise InputError(
            f"{name}: this machine is no node of a Ray cluster; start one with ray start --head, or name a head as "
            "HOST:PORT; --workers needs no cluster"
        )
    host, _, port = head.rpartition(":")
    if not (host and port.isascii() and port.isdecimal() and 0 < int(port[:6]) < 1 << 16) or "/" in host:
        raise InputError(
            f"--ray: is {head!r:.80}; allowed: auto, or HOST:PORT of a cluster's head, such as 10.0.0.5:6379"
        )
    try:
        socket.create_connection((host.strip("[]"), int(port)), _CONNECT_TIMEOUT_S).close()
    except OSError as error:
        raise InputError(f"{name}: nothing answers at {head}: {error.strerror or error}") from None
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
