"""Work on the nodes of a cluster: order of results, bounds, progress, lost tasks, errors, and interrupts."""

from collections.abc import Iterator

import pytest
from fake_ray import FakeRay, RayError, install_fake_ray

from simbev_ros.dataset.parallel import Processes, call_on_step, report_step
from simbev_ros.foundation.errors import InputError, SimbevError
from simbev_ros.production.cluster import ray_task_pool
from simbev_ros.production.cluster.ray_cluster import RayCluster
from simbev_ros.production.cluster.ray_task_pool import RayTaskPool


@pytest.fixture
def ray(monkeypatch: pytest.MonkeyPatch) -> Iterator[FakeRay]:
    """A cluster of two nodes with eight CPUs in all; every look at it is a fresh one."""
    monkeypatch.setattr(ray_task_pool, "_NODES_S", 0.0)
    fake = install_fake_ray(monkeypatch)
    for name in ("aaaaaaaa", "bbbbbbbb"):
        fake.add_node(name)
    yield fake
    call_on_step(lambda: None)


@pytest.fixture
def pool(ray: FakeRay) -> Iterator[RayTaskPool]:
    with RayCluster("auto", reaps_graphs=False) as cluster:
        yield RayTaskPool(cluster, 512)


def double(item: int) -> int:
    return 2 * item


def refuse(item: int) -> int:
    if item == 2:
        raise InputError("is 2", parameter="item")
    return item


def three_steps(item: int) -> int:
    for _ in range(3):
        report_step()
    return item


def test_results_are_in_the_order_of_the_items_as_those_of_processes(pool: RayTaskPool) -> None:
    assert list(pool.map(double, range(100))) == list(Processes(2).map(double, range(100)))


def test_nothing_is_run_for_no_items(pool: RayTaskPool, ray: FakeRay) -> None:
    assert list(pool.map(double, [])) == [] and not ray.tasks


def test_a_task_asks_for_one_cpu_and_its_memory_and_is_run_again_if_it_is_lost(pool: RayTaskPool, ray: FakeRay) -> None:
    list(pool.map(double, [1]))
    assert ray.task_options == {"num_cpus": 1, "memory": 512 << 20, "max_retries": 5}


def test_four_tasks_per_cpu_are_submitted_before_their_results_are_used(pool: RayTaskPool, ray: FakeRay) -> None:
    results = pool.map(double, range(1000))
    assert next(results) == 0 and len(ray.tasks) == 32
    assert next(results) == 2 and len(ray.tasks) == 33
    ray.add_node("cccccccc", cpus=2)
    assert next(results) == 4 and len(ray.tasks) == 42
    results.close()


def test_work_begins_on_a_cluster_whose_nodes_are_still_to_come(pool: RayTaskPool, ray: FakeRay) -> None:
    ray.listed.clear()
    assert list(pool.map(double, range(40))) == [2 * item for item in range(40)]


def test_without_a_node_for_a_long_time_the_work_fails(
    pool: RayTaskPool, ray: FakeRay, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(ray_task_pool, "_NODE_PATIENCE_S", 0.0)
    ray.listed.clear()
    ray.is_stuck = True
    with pytest.raises(SimbevError, match=r"^no node with CPUs has joined the cluster within 0 min$"):
        list(pool.map(double, range(3)))


def test_an_error_of_the_work_is_raised_as_it_is_and_ends_the_other_tasks(pool: RayTaskPool, ray: FakeRay) -> None:
    results = pool.map(refuse, range(5))
    assert [next(results), next(results)] == [0, 1]
    with pytest.raises(InputError, match=r"^item: is 2$") as raised:
        next(results)
    assert raised.value.parameter == "item"
    assert [task.cancels for task in ray.tasks] == [[], [], [], [False], [False]]


def test_a_task_that_was_lost_too_often_is_reported_in_one_line(pool: RayTaskPool, ray: FakeRay) -> None:
    ray.losses = [None, RayError("The worker died unexpectedly\n  while executing this task.\n\nAdvice.")]
    expected = "work on the cluster was lost 6 times: The worker died unexpectedly while executing this task."
    with pytest.raises(SimbevError) as raised:
        list(pool.map(double, range(3)))
    assert str(raised.value) == expected


def test_steps_of_all_tasks_are_reported_and_those_of_one_that_is_run_again_count_once(
    pool: RayTaskPool, ray: FakeRay
) -> None:
    totals = ray_task_pool._StepTotal()
    for number in (0, 1, 1):
        assert ray_task_pool._run(three_steps, number, number, totals.counter) == number
    assert [totals.get(), totals.get()] == [0, 6], "the first answer is from before the steps"


def test_progress_is_reported_while_a_result_is_awaited(
    pool: RayTaskPool, ray: FakeRay, monkeypatch: pytest.MonkeyPatch
) -> None:
    reported: list[int] = []

    def report(steps: int) -> None:
        reported.append(steps)
        ray.is_stuck = len(reported) < 3

    ray.is_stuck = True
    assert list(pool.map(three_steps, [7], report)) == [7]
    assert reported == [0, 0, 0]


def test_tasks_are_interrupted_when_the_caller_stops(pool: RayTaskPool, ray: FakeRay) -> None:
    results = pool.map(double, range(4))
    next(results)
    results.close()
    assert [task.cancels for task in ray.tasks] == [[], [False], [False], [False]]


def test_tasks_that_an_interrupt_does_not_end_are_killed(pool: RayTaskPool, ray: FakeRay) -> None:
    results = pool.map(double, range(3))
    next(results)
    ray.is_stuck = True
    results.close()
    assert [task.cancels for task in ray.tasks] == [[], [False, True], [False, True]]


def test_a_cluster_whose_nodes_are_too_small_is_refused(ray: FakeRay) -> None:
    with (
        RayCluster("auto", reaps_graphs=False) as cluster,
        pytest.raises(InputError, match=r"^ray: a task takes 9000 MiB, the largest node offers 8\.0 GiB$"),
    ):
        RayTaskPool(cluster, 9000)
