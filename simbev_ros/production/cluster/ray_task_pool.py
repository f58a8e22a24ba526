"""Work over bags on the nodes of a Ray cluster: a pool that does what processes do on one machine.

Each item is a task of Ray with one CPU. Tasks of a process or node that has died are run again on any node.
"""

import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from itertools import islice
from typing import Any, TypeVar

from simbev_ros.dataset.parallel import call_on_step
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.production.cluster.ray_cluster import RayCluster, largest, one_line

W = TypeVar("W")
R = TypeVar("R")

_POLL_S, _NODES_S = 0.2, 5.0
"""Time between two reports of the progress, and between two looks at the nodes."""
_NOTE_S = 0.5
"""Time between two messages of a task about its steps."""
_TASKS_PER_CPU, _MIN_TASKS = 4, 16
"""Number of tasks that are submitted before their results are consumed; a cluster may begin without CPUs."""
_MAX_RETRIES = 5
_CANCEL_S = 10.0
"""Maximum time that interrupted tasks have to clean up; they are killed then."""
_NODE_PATIENCE_S = 900.0
"""Maximum time for the first node with CPUs to join a cluster that begins without any."""


class RayTaskPool:
    """Spreads work over all CPUs of a cluster; nodes that join later take part.

    Args:
        cluster: The cluster; its nodes have been checked.
        memory_mib: Memory that one item takes.

    Raises:
        InputError: No node has so much memory.
    """

    def __init__(self, cluster: RayCluster, memory_mib: int) -> None:
        self._cluster, self._memory_mib = cluster, memory_mib
        self._tasks, self._looked_s, self._began_s = 0, float("-inf"), time.monotonic()
        nodes = [node for node in cluster.nodes() if node.cpus >= 1]
        if nodes and not any(node.memory_mib >= memory_mib for node in nodes):
            raise InputError(
                f"a task takes {memory_mib} MiB, the largest node offers {largest(nodes)}", parameter="ray"
            )

    def map(
        self, work: Callable[[W], R], items: Sequence[W], report: Callable[[int], None] = lambda steps: None
    ) -> Iterator[R]:
        """See ``Pool``. Errors of the work are raised as they are."""
        import ray

        run = ray.remote(
            num_cpus=1, memory=self._memory_mib << 20, max_retries=_MAX_RETRIES, scheduling_strategy="SPREAD"
        )(_run)
        rest, waiting, shared, steps = enumerate(items), deque[Any](), ray.put(work), _StepTotal()
        try:
            while True:
                new = islice(rest, max(self._max_tasks() - len(waiting), 0))
                waiting += [run.remote(shared, item, number, steps.counter) for number, item in new]
                if not waiting:
                    return
                while not ray.wait([waiting[0]], timeout=_POLL_S)[0]:
                    report(steps.get())
                    self._max_tasks()
                yield ray.get(waiting.popleft())
        except ray.exceptions.RayTaskError as error:
            raise error.cause or SimbevError(str(error).strip().splitlines()[-1]) from None
        except ray.exceptions.RayError as error:
            raise SimbevError(f"work on the cluster was lost {_MAX_RETRIES + 1} times: {one_line(error)}") from None
        finally:
            _cancel(waiting)
            steps.close()

    def _max_tasks(self) -> int:
        """Number of tasks to submit; looks at the nodes now and then.

        Raises:
            SimbevError: No node with CPUs has joined for a long time.
        """
        now_s = time.monotonic()
        if now_s - self._looked_s >= _NODES_S:
            self._looked_s = now_s
            cpus = sum(int(node.cpus) for node in self._cluster.nodes())
            if cpus:
                self._began_s = now_s
            elif now_s - self._began_s > _NODE_PATIENCE_S:
                raise SimbevError(f"no node with CPUs has joined the cluster within {_NODE_PATIENCE_S / 60:g} min")
            self._tasks = max(cpus * _TASKS_PER_CPU, _MIN_TASKS)
        return self._tasks


class _StepTotal:
    """The driver's end of a ``_StepCounter``, which lives on the same node."""

    def __init__(self) -> None:
        import ray
        from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
        self.counter = ray.remote(_StepCounter).options(num_cpus=0, scheduling_strategy=here).remote()
        self._asked, self._total = self.counter.total.remote(), 0

    def get(self) -> int:
        """Number of steps of all tasks; does not wait for the counter."""
        import ray

        if ray.wait([self._asked], timeout=0)[0]:
            self._total, self._asked = ray.get(self._asked), self.counter.total.remote()
        return self._total

    def close(self) -> None:
        """End the counter."""
        import ray

        ray.kill(self.counter, no_restart=True)


class _StepCounter:
    """Actor that adds up the steps of all tasks; one that is run again begins at 0."""

    def __init__(self) -> None:
        self._steps: dict[int, int] = {}

    def note(self, number: int, steps: int) -> None:
        """Note how many steps of an item are done."""
        self._steps[number] = steps

    def total(self) -> int:
        """Number of steps of all items."""
        return sum(self._steps.values())


class _TaskSteps:
    """Counts the steps of a task, and reports them to the counter now and then."""

    def __init__(self, number: int, counter: Any) -> None:
        self._number, self._counter, self._steps, self._noted_s = number, counter, 0, time.monotonic()

    def count(self) -> None:
        """Count a step."""
        self._steps += 1
        if time.monotonic() - self._noted_s >= _NOTE_S:
            self.note()

    def note(self) -> None:
        """Report to the counter; return at once."""
        if self._steps:
            self._noted_s = time.monotonic()
            self._counter.note.remote(self._number, self._steps)


def _run(work: Callable[[W], R], item: W, number: int, counter: Any) -> R:
    """Runs on a node."""
    steps = _TaskSteps(number, counter)
    call_on_step(steps.count)
    result = work(item)
    steps.note()
    return result


def _cancel(tasks: Sequence[Any]) -> None:
    """End tasks with results that nothing needs: by an interrupt, so that they clean up, and then by force."""
    import ray

    left = list(tasks)
    for is_forced in (False, True):
        for task in left:
            ray.cancel(task, force=is_forced)
        if left:
            left = ray.wait(left, num_returns=len(left), timeout=_CANCEL_S, fetch_local=False)[1]
