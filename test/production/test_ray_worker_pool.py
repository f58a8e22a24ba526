"""Crews on a cluster: what workers ask for, how many there are, and how both follow what scenes cost."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_pool import COST
from fake_ray import FakeActor, FakeRay

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import GraphError, InputError
from simbev_ros.production.cluster.ray_cluster import RayCluster
from simbev_ros.production.scene_ending import MadeScene
from simbev_ros.production.workers.messages import Signal
from simbev_ros.production.workers.ray_worker import Answer
from simbev_ros.production.workers.ray_worker_pool import RayWorkerPool
from simbev_ros.schema.scene.map_spec import MapSpec

Open = Callable[..., RayWorkerPool]
MIB = 1 << 20


@pytest.fixture
def open_worker_pool(ray: FakeRay, tmp_path: Path) -> Iterator[Open]:
    """Function that opens a pool for a number of scenes, with a number of cameras, on the cluster as it is."""
    with ExitStack() as held:

        def open_worker_pool(scenes: int, *, cameras: int = 0, gpus: Any = "auto", **options: Any) -> RayWorkerPool:
            for node in ray.listed:
                ray.answers["_reap_on_node", node["NodeID"]] = None
            sensors = [{"type": "camera", "name": f"camera_{k}"} for k in range(cameras)]
            content = {"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": sensors}}
            scenario = Scenario.model_validate({**content, "rendering": {"gpus": gpus}})
            cluster = held.enter_context(RayCluster("auto"))
            return held.enter_context(RayWorkerPool(cluster, scenario, tmp_path, scenes, **options))

        yield open_worker_pool


def running(ray: FakeRay) -> list[FakeActor]:
    """Actors that were not killed."""
    return [actor for actor in ray.actors if "kill" not in actor.calls]


def asked(actor: FakeActor) -> tuple[float, float, float]:
    """CPUs, memory in MiB and GPUs that an actor asks for."""
    return actor.options["num_cpus"], actor.options["memory"] / MIB, actor.options["num_gpus"]


def place(*actors: FakeActor) -> None:
    """Let actors find a node; their workers are ready."""
    for actor in actors:
        actor.answer(Answer("node a", [Signal.READY], None))


def make_scene(pool: RayWorkerPool, actor: FakeActor, cores: float = 2.0, memory_mib: float = 1500.0) -> None:
    """Let an actor make a scene with a certain cost; its worker is ready again."""
    worker = next(worker for worker in pool.idle() if worker.name == actor.arguments[0])
    pool.submit(worker, PlannedEntry(number=0, map="Blocks", split="train"))
    cost = replace(COST, cpu_s=cores, memory_mib=memory_mib)
    actor.answer(Answer("node a", [MadeScene({}, "made", {}, cost), Signal.READY], None))
    assert len(pool.wait(0.0)) == 1


def needs_after(pool: RayWorkerPool, ray: FakeRay, *costs: tuple[float, float]) -> tuple[float, float, float]:
    """What new actors ask for after scenes with certain cores and memory in MiB."""
    for cores, memory_mib in costs:
        actor = running(ray)[0]
        if len(actor.polls) == 1:
            place(actor)
            pool.wait(0.0)
        make_scene(pool, actor, cores, memory_mib)
        pool.wait(0.0)
    return asked(running(ray)[-1])


def test_workers_ask_for_two_cpus_and_two_gibibytes_at_first(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a")
    open_worker_pool(9)
    assert [asked(actor) for actor in ray.actors] == [(2, 2048, 0)] * 2


def test_on_nodes_of_one_cpu_a_worker_asks_for_one(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", cpus=1)
    open_worker_pool(9)
    assert asked(ray.actors[0]) == (1, 2048, 0)


@pytest.mark.parametrize(
    ("cameras", "gpus", "share"), [(1, "auto", 0.25), (0, "auto", 0.0), (1, [], 0.0)], ids=["draws", "blind", "on CPU"]
)
def test_workers_that_draw_on_gpus_ask_for_a_part_of_one(
    ray: FakeRay, open_worker_pool: Open, cameras: int, gpus: Any, share: float
) -> None:
    ray.add_node("a", gpus=1)
    open_worker_pool(9, cameras=cameras, gpus=gpus)
    assert asked(ray.actors[0]) == (2, 2048, share)


def test_without_gpus_no_worker_asks_for_one(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a")
    open_worker_pool(9, cameras=1)
    assert asked(ray.actors[0]) == (2, 2048, 0)


def test_too_little_memory_on_every_node_is_refused(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", memory_mib=1024)
    ray.add_node("b", memory_mib=1536)
    with pytest.raises(InputError, match=r"^ray: a graph takes 2 GiB of memory, the largest node offers 1\.5 GiB$"):
        open_worker_pool(9)
    assert not ray.actors


def test_one_node_with_enough_memory_suffices(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", memory_mib=1024)
    ray.add_node("b", memory_mib=2048)
    assert open_worker_pool(9).machines == 2


def test_a_cluster_may_begin_without_nodes_that_have_cpus(
    ray: FakeRay, open_worker_pool: Open, clock: list[float]
) -> None:
    ray.add_node("head", cpus=0)
    pool = open_worker_pool(9)
    assert pool.machines == 1 and len(ray.actors) == 2
    clock[0] += 890.0
    pool.wait(0.0)
    clock[0] += 20.0
    with pytest.raises(GraphError, match=r"^no node with CPUs has joined the cluster within 15 min$"):
        pool.wait(0.0)


def test_nodes_that_join_count_as_machines(ray: FakeRay, open_worker_pool: Open, clock: list[float]) -> None:
    ray.add_node("a")
    pool = open_worker_pool(9)
    ray.add_node("b")
    ray.answers["_reap_on_node", "b"] = None
    pool.wait(0.0)
    assert pool.machines == 1, "nodes are not looked at all the time"
    clock[0] += 6.0
    pool.wait(0.0)
    assert pool.machines == 2


@pytest.mark.parametrize(("scenes", "workers"), [(0, 0), (1, 1), (2, 2), (3, 2), (100, 2)])
def test_at_first_two_workers_wait_for_room_but_not_more_than_scenes(
    ray: FakeRay, open_worker_pool: Open, scenes: int, workers: int
) -> None:
    ray.add_node("a")
    open_worker_pool(scenes)
    assert len(ray.actors) == workers


def test_as_many_workers_as_there_are_wait_for_room(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a")
    pool = open_worker_pool(100)
    numbers = []
    for _ in range(4):
        place(*(actor for actor in ray.actors if not actor.polls[0].values))
        pool.wait(0.0)
        pool.wait(0.0)
        numbers.append(len(ray.actors))
    assert numbers == [4, 8, 16, 32]


def test_no_more_workers_are_asked_for_than_scenes_are_left(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a")
    pool = open_worker_pool(3)
    place(*ray.actors)
    pool.wait(0.0)
    pool.wait(0.0)
    assert len(ray.actors) == 3
    make_scene(pool, ray.actors[0])
    make_scene(pool, ray.actors[0])
    pool.wait(0.0)
    assert len(ray.actors) == 3


@pytest.mark.parametrize(
    ("cores", "memory_mib", "expected"),
    [
        (2.7, 1500.0, (2, 2048, 0)),
        (2.8, 1500.0, (3, 2048, 0)),
        (1.3, 1500.0, (2, 2048, 0)),
        (1.2, 1500.0, (1, 2048, 0)),
        (0.1, 1500.0, (1, 2048, 0)),
        (15.0, 1500.0, (4, 2048, 0)),
        (2.0, 1706.0, (2, 2048, 0)),
        (2.0, 1710.0, (2, 2304, 0)),
        (2.0, 900.0, (2, 2048, 0)),
        (2.0, 640.0, (2, 768, 0)),
        (2.0, 0.0, (2, 256, 0)),
    ],
)
def test_needs_follow_what_a_scene_costs_where_they_are_off_by_much(
    ray: FakeRay, open_worker_pool: Open, cores: float, memory_mib: float, expected: tuple[float, float, float]
) -> None:
    ray.add_node("a", cpus=16, memory_mib=65536)
    assert needs_after(open_worker_pool(100), ray, (cores, memory_mib)) == expected


def test_costs_that_vary_a_little_do_not_change_the_needs_to_and_fro(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", cpus=16, memory_mib=65536)
    pool = open_worker_pool(100)
    assert needs_after(pool, ray, (2.9, 1800.0)) == (3, 2304, 0)
    actors = len(ray.actors)
    costs = [(3.6, 1600.0), (2.4, 1850.0), (3.0, 1200.0)]
    assert needs_after(pool, ray, *costs) == (3, 2304, 0) and len(running(ray)) >= actors - 2


def test_workers_with_outdated_needs_are_replaced_when_they_are_idle(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", cpus=16, memory_mib=65536)
    pool = open_worker_pool(100)
    first, second = ray.actors
    place(first, second)
    pool.wait(0.0)
    busy = next(worker for worker in pool.idle() if worker.name == second.arguments[0])
    pool.submit(busy, PlannedEntry(number=1, map="Blocks", split="train"))
    make_scene(pool, first, cores=4.0)
    pool.wait(0.0)
    assert first.calls == ["submit 0", "end", "kill"] and second.calls == ["submit 1"]
    assert all(asked(actor) == (4, 2048, 0) for actor in running(ray) if actor is not second)
    cost = replace(COST, cpu_s=4.0, memory_mib=1500.0)
    second.answer(Answer("node a", [MadeScene({}, "made", {}, cost), Signal.READY], None))
    pool.wait(0.0)
    pool.wait(0.0)
    assert second.calls == ["submit 1", "end", "kill"]


def test_workers_without_a_node_are_replaced_at_once(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a", cpus=16, memory_mib=65536)
    pool = open_worker_pool(100)
    waiting = ray.actors[1]
    place(ray.actors[0])
    pool.wait(0.0)
    make_scene(pool, ray.actors[0], cores=4.0)
    pool.wait(0.0)
    assert waiting.calls == ["kill"]


@pytest.mark.parametrize(("maps", "names"), [(None, ["Blocks"]), ((), [])], ids=["configured", "none"])
def test_workers_are_sent_the_configured_maps_or_those_that_are_given(
    ray: FakeRay, open_worker_pool: Open, maps: tuple[MapSpec, ...] | None, names: list[str]
) -> None:
    ray.add_node("a")
    open_worker_pool(1, maps=maps)
    assert [spec.name for spec in ray.actors[0].arguments[1].maps] == names


def test_all_workers_end_with_the_pool(ray: FakeRay, open_worker_pool: Open) -> None:
    ray.add_node("a")
    with open_worker_pool(9) as pool:
        place(ray.actors[0])
        pool.wait(0.0)
    assert ray.actors[0].calls == ["end", "kill"] and not running(ray)
