"""A Ray cluster without processes, in place of the module ``ray``: tests say what its nodes and actors answer.

Tasks that may run on any node are run in this process when they are waited for.
"""

import socket
import sys
import weakref
from collections.abc import Mapping, Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest


class RayError(Exception):
    """Base of Ray's errors."""


class GetTimeoutError(RayError):
    """An answer took too long."""


class ActorDiedError(RayError):
    """An actor has died."""


class RayTaskError(RayError):
    """A task or actor has raised an error."""

    def __init__(self, text: str, cause: Exception | None = None) -> None:
        super().__init__(text)
        self.cause = cause


class Ref:
    """A reference to what may not be there yet; an exception is raised when it is asked for."""

    def __init__(self, *values: Any) -> None:
        self.values = list(values)

    def get(self) -> Any:
        [value] = self.values
        if isinstance(value, Exception):
            raise value
        return value


class FakeActor:
    """An actor whose polls a test answers.

    Attributes:
        options: What it asks of its node.
        arguments: Arguments of its constructor.
        calls: Calls other than polls.
        polls: References to the answers to all polls.
    """

    def __init__(self, options: Mapping[str, Any], arguments: tuple[Any, ...]) -> None:
        self.options, self.arguments = options, arguments
        self.calls: list[str] = []
        self.polls: list[Ref] = []
        self.poll = SimpleNamespace(remote=self._poll)
        self.submit = SimpleNamespace(remote=lambda entry: self.calls.append(f"submit {entry.number}"))
        self.end = SimpleNamespace(remote=self._end)

    def answer(self, value: Any) -> None:
        """Answer the latest poll."""
        self.polls[-1].values.append(value)

    def _poll(self) -> Ref:
        self.polls.append(Ref())
        return self.polls[-1]

    def _end(self) -> Ref:
        self.calls.append("end")
        return Ref(None)


class CalledActor:
    """An actor whose methods are called at once."""

    def __init__(self, instance: Any) -> None:
        self._instance, self.calls = instance, list[str]()

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._instance, name)
        return SimpleNamespace(remote=lambda *arguments: Ref(method(*arguments)))


class FakeTask(Ref):
    """A task that has been submitted.

    Attributes:
        arguments: Arguments of its function.
        cancels: Whether each request to end it was one by force.
    """

    def __init__(self, function: Any, arguments: tuple[Any, ...]) -> None:
        super().__init__()
        self._function, self.cancels = function, list[bool]()
        self.arguments = [each.get() if isinstance(each, Ref) else each for each in arguments]

    def run(self, loss: Exception | None) -> None:
        """Run it to its end, or lose it."""
        try:
            self.values.append(loss or self._function(*self.arguments))
        except Exception as error:
            self.values.append(RayTaskError(f"Traceback\n{error}", error))


class FakeGauge:
    """A metric; ``values`` has the latest value of each by name."""

    values: dict[str, float]
    tags: dict[str, dict[str, str]]

    def __init__(self, name: str, description: str, tag_keys: Sequence[str]) -> None:
        self._name = name

    def set_default_tags(self, tags: dict[str, str]) -> None:
        self.tags[self._name] = tags

    def set(self, value: float) -> None:
        self.values[self._name] = value


class FakeRay(ModuleType):
    """The module.

    Attributes:
        listed: Nodes as Ray lists them.
        refusal: Error of ``init``; None: it connects.
        answers: What a function with a name answers on the node with an id; otherwise it is called here.
        actors: All actors that were started.
        gpu_ids: GPUs that an actor was given.
        tasks: All tasks that may run on any node.
        task_options: What the latest one asks for.
        losses: Errors by which the next tasks are lost; None: it is not.
        is_stuck: Whether tasks do not end by themselves, but by force.
        is_open: Whether there is a connection.
    """

    def __init__(self) -> None:
        super().__init__("ray")
        self.__spec__ = ModuleSpec("ray", None)
        self.listed: list[dict[str, Any]] = []
        self.refusal: Exception | None = None
        self.answers: dict[tuple[str, str], Any] = {}
        self.actors: list[FakeActor] = []
        self.gpu_ids: list[Any] = []
        self.tasks: list[FakeTask] = []
        self.task_options: dict[str, Any] = {}
        self.losses: list[Exception | None] = []
        self.is_stuck = False
        self.is_open = False
        self.exceptions = SimpleNamespace(RayError=RayError, GetTimeoutError=GetTimeoutError, RayTaskError=RayTaskError)
        self.util = ModuleType("ray.util")
        self.util.get_node_ip_address = lambda: "10.0.0.1"  # type: ignore[attr-defined]

    def add_node(self, name: str, cpus: float = 4, memory_mib: float = 8192, gpus: float = 0) -> None:
        """Let a node join; its address is 10.0.0. and its number."""
        offers = {"CPU": cpus, "memory": memory_mib * 2**20, "GPU": gpus}
        self.listed.append(
            {
                "NodeID": name,
                "NodeManagerAddress": f"10.0.0.{len(self.listed) + 1}",
                "Alive": True,
                "Resources": {key: value for key, value in offers.items() if value},
            }
        )

    def init(self, address: str, **_: Any) -> Any:
        if self.refusal is not None:
            raise self.refusal
        self.is_open = True
        return SimpleNamespace(address_info={"gcs_address": address})

    def shutdown(self) -> None:
        self.is_open = False

    def nodes(self) -> list[dict[str, Any]]:
        return self.listed

    def remote(self, actor_class: Any = None, *, scheduling_strategy: Any = None, **options: Any) -> Any:
        """Functions with a node to run on, functions that may run on any node, and classes of actors."""
        if hasattr(actor_class, "poll"):
            return SimpleNamespace(options=lambda **options: SimpleNamespace(remote=self._starter(options)))
        if actor_class is not None:
            return SimpleNamespace(options=lambda **_: SimpleNamespace(remote=lambda: CalledActor(actor_class())))

        def on_any(function: Any) -> Any:
            self.task_options = options
            return SimpleNamespace(remote=lambda *arguments: self._submit(FakeTask(function, arguments)))

        if scheduling_strategy == "SPREAD":
            return on_any

        def on_node(function: Any) -> Any:
            key = (function.__name__, scheduling_strategy)
            return SimpleNamespace(
                remote=lambda *arguments: Ref(self.answers[key] if key in self.answers else function(*arguments))
            )

        return on_node

    def _starter(self, options: Mapping[str, Any]) -> Any:
        def start(*arguments: Any) -> FakeActor:
            self.actors.append(FakeActor(options, arguments))
            return self.actors[-1]

        return start

    def _submit(self, task: FakeTask) -> FakeTask:
        self.tasks.append(task)
        return task

    def cancel(self, task: FakeTask, *, force: bool) -> None:
        task.cancels.append(force)
        if force or not self.is_stuck:
            task.values.append(RayError("cancelled"))

    def get(self, ref: Ref, timeout: float | None = None) -> Any:
        return ref.get()

    def wait(
        self, refs: list[Ref], num_returns: int = 1, timeout: float | None = None, fetch_local: bool = True
    ) -> tuple[list[Ref], list[Ref]]:
        for ref in refs:
            if isinstance(ref, FakeTask) and not ref.values and not self.is_stuck:
                ref.run(self.losses.pop(0) if self.losses else None)
        return [ref for ref in refs if ref.values], [ref for ref in refs if not ref.values]

    def put(self, value: Any) -> Ref:
        return Ref(value)

    def kill(self, actor: FakeActor | CalledActor, *, no_restart: bool) -> None:
        assert no_restart
        actor.calls.append("kill")

    def get_gpu_ids(self) -> list[Any]:
        return self.gpu_ids

    def get_runtime_context(self) -> Any:
        return SimpleNamespace(get_node_id=lambda: "abcdef0123")


def install_fake_ray(monkeypatch: pytest.MonkeyPatch) -> FakeRay:
    """Put a cluster without nodes in place of Ray; this machine belongs to it."""
    fake = FakeRay()
    head = socket.create_server(("127.0.0.1", 0))
    weakref.finalize(fake, head.close)
    monkeypatch.setenv("RAY_ADDRESS", f"127.0.0.1:{head.getsockname()[1]}")
    strategies, metrics = ModuleType("ray.util.scheduling_strategies"), ModuleType("ray.util.metrics")
    strategies.NodeAffinitySchedulingStrategy = lambda node_id, soft: node_id  # type: ignore[attr-defined]
    gauge = type("Gauge", (FakeGauge,), {"values": {}, "tags": {}})
    metrics.Gauge = gauge  # type: ignore[attr-defined]
    for module in (fake, fake.util, strategies, metrics):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return fake
