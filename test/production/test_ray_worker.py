"""The driver's end of a worker on a cluster: answers of its actor, and how its end and silence are noticed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest
from fake_ray import ActorDiedError, FakeActor, FakeRay, RayTaskError, Ref

from simbev_ros.config.scenario import Scenario
from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import InputError, RenderError
from simbev_ros.maps.source import map_spec
from simbev_ros.production.cluster.node_check import Code
from simbev_ros.production.workers import ray_worker
from simbev_ros.production.workers.messages import Settings, Signal
from simbev_ros.production.workers.ray_worker import Answer, Needs, RayWorker, WorkerActor
from simbev_ros.production.workers.supervised_pool import WorkerLost
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.simulation.render.gl.devices import EglDevice

ENTRY = PlannedEntry(number=3, map="Blocks", split="val")
SCENARIO = Scenario.model_validate({"scenes": [{"map": "Blocks", "train": 1}], "rig": {"sensors": []}})
CODE = Code.here()
NODE = "node abcdef at 10.0.0.1"


@pytest.fixture
def worker(ray: FakeRay) -> RayWorker:
    return RayWorker(Worker("worker-1", ""), Needs(2, 1024, 0.25), Settings(SCENARIO, None), CODE, {})


@pytest.fixture
def actor(ray: FakeRay, worker: RayWorker) -> FakeActor:
    return ray.actors[0]


def placed(worker: RayWorker, actor: FakeActor) -> None:
    """Let the actor answer for the first time."""
    actor.answer(Answer(NODE, [Signal.READY], None))
    assert worker.read() == [Signal.READY]


def test_an_actor_asks_for_what_its_worker_needs_and_is_not_restarted(actor: FakeActor) -> None:
    wanted = {"num_cpus": 2, "num_gpus": 0.25, "memory": 1 << 30, "max_restarts": 0, "scheduling_strategy": "SPREAD"}
    assert wanted.items() <= actor.options.items()
    assert actor.arguments == ("worker-1", Settings(SCENARIO, None), CODE, {})


def test_an_actor_that_waits_for_room_is_never_silent(worker: RayWorker, actor: FakeActor, clock: list[float]) -> None:
    clock[0] += 1e6
    assert worker.read() == [] and not worker.is_placed


def test_the_first_answer_names_the_node(worker: RayWorker, actor: FakeActor) -> None:
    placed(worker, actor)
    assert worker.is_placed and worker.worker == Worker("worker-1", NODE)
    assert len(actor.polls) == 2, "it is polled again"


def test_scenes_are_given_to_the_actor(worker: RayWorker, actor: FakeActor) -> None:
    worker.submit(ENTRY)
    assert actor.calls == ["submit 3"]


def test_a_worker_is_lost_after_a_minute_of_silence(worker: RayWorker, actor: FakeActor, clock: list[float]) -> None:
    placed(worker, actor)
    clock[0] += 59.0
    assert worker.read() == []
    clock[0] += 2.0
    with pytest.raises(WorkerLost, match=rf"^worker-1 on {NODE} has been silent for 60 s$"):
        worker.read()


def test_each_answer_is_a_sign_of_life(worker: RayWorker, actor: FakeActor, clock: list[float]) -> None:
    for _ in range(3):
        actor.answer(Answer(NODE, [], None))
        assert worker.read() == []
        clock[0] += 59.0
    assert worker.read() == []


def test_an_actor_that_dies_is_a_loss_on_its_node(worker: RayWorker, actor: FakeActor) -> None:
    placed(worker, actor)
    actor.answer(ActorDiedError("a page of text"))
    with pytest.raises(WorkerLost, match=rf"^worker-1 on {NODE} was lost: ActorDiedError$"):
        worker.read()


def test_an_actor_that_dies_before_it_has_a_node_is_a_loss(worker: RayWorker, actor: FakeActor) -> None:
    actor.answer(ActorDiedError("a page of text"))
    with pytest.raises(WorkerLost, match=r"^worker-1 was lost: ActorDiedError$"):
        worker.read()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (RayTaskError("Traceback\nRenderError: no GPU", RenderError("no GPU")), "no GPU"),
        (RayTaskError("Traceback\n  line 3\nValueError: is 3\n"), "ValueError: is 3"),
    ],
    ids=["known", "unknown"],
)
def test_an_error_of_the_actor_is_the_reason_of_the_loss(
    worker: RayWorker, actor: FakeActor, error: Exception, message: str
) -> None:
    actor.answer(error)
    with pytest.raises(WorkerLost, match=rf"^{message}$"):
        worker.read()


def test_a_loss_that_the_actor_reports_follows_its_last_messages(worker: RayWorker, actor: FakeActor) -> None:
    actor.answer(Answer(NODE, ["last words"], "worker-1 died: killed"))
    assert worker.read() == ["last words"]
    actor.answer(Answer(NODE, [], "worker-1 died: killed"))
    with pytest.raises(WorkerLost, match=r"^worker-1 died: killed$"):
        worker.read()


def test_a_placed_worker_is_asked_to_end_before_it_is_killed(worker: RayWorker, actor: FakeActor) -> None:
    placed(worker, actor)
    worker.end()
    worker.join()
    assert actor.calls == ["end", "kill"]


def test_a_worker_without_a_node_is_killed_without_being_asked(worker: RayWorker, actor: FakeActor) -> None:
    worker.end()
    worker.join()
    assert actor.calls == ["kill"]


class FakeLocalWorker:
    """The process of an actor; batches are read one by one, and an exception is raised."""

    batches: list[list[Any] | WorkerLost]

    def __init__(self, worker: Worker, settings: Settings) -> None:
        self.worker, self.settings, self.connection = worker, settings, None

    def read(self) -> list[Any]:
        batch = self.batches.pop(0)
        if isinstance(batch, WorkerLost):
            raise batch
        return batch


def actor_with(
    monkeypatch: pytest.MonkeyPatch,
    batches: list[list[Any] | WorkerLost],
    files: Mapping[MapSpec, Any] | None = None,
    code: Code = CODE,
) -> WorkerActor:
    """An actor whose process sends batches of messages."""
    monkeypatch.setattr(FakeLocalWorker, "batches", batches, raising=False)
    monkeypatch.setattr(ray_worker, "LocalWorker", FakeLocalWorker)
    monkeypatch.setattr(ray_worker, "wait", lambda connections, timeout_s: connections)
    monkeypatch.setenv(ray_worker.MAP_FILES_VARIABLE, "")
    return WorkerActor("worker-1", Settings(SCENARIO, None), code, files or {})


def test_an_actor_on_a_node_with_other_code_refuses_to_work(ray: FakeRay, monkeypatch: pytest.MonkeyPatch) -> None:
    actor = actor_with(monkeypatch, [], code=Code("0.0.9", CODE.inputs))
    [refusal] = actor.poll().messages
    assert isinstance(refusal, InputError)
    assert str(refusal) == f"{NODE}: has simbev_ros {CODE.version}, this machine 0.0.9"
    actor.submit(ENTRY)
    actor.end()


def test_an_actor_passes_on_at_once_what_the_driver_waits_for(ray: FakeRay, monkeypatch: pytest.MonkeyPatch) -> None:
    actor = actor_with(monkeypatch, [[Signal.HEARTBEAT], [Signal.HEARTBEAT, Signal.READY], [Signal.HEARTBEAT]])
    assert actor.poll() == Answer(NODE, [Signal.READY], None)


def test_an_actor_reports_the_loss_of_its_process(ray: FakeRay, monkeypatch: pytest.MonkeyPatch) -> None:
    actor = actor_with(monkeypatch, [[Signal.HEARTBEAT], WorkerLost("worker-1 died: 1")])
    answer = actor.poll()
    assert answer.loss == "worker-1 died: 1"


def test_a_map_file_that_a_node_lacks_is_written_into_its_cache(
    ray: FakeRay, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    here, gone = tmp_path / "here.xodr", tmp_path / "gone.xodr"
    for file in (here, gone):
        file.write_text(file.name)
    monkeypatch.setattr(ray_worker, "default_cache_dir", lambda: tmp_path / "cache")
    files = {map_spec(str(file)): Ref(file.read_bytes()) for file in (here, gone)}
    gone.unlink()
    actor_with(monkeypatch, [], files)
    assert [path.read_text() for path in (tmp_path / "cache/map_files").iterdir()] == ["gone.xodr"]


@pytest.mark.parametrize(
    ("given", "cuda", "chosen"),
    [
        ([1], [0, 1], (1,)),
        (["0", "2"], [2, None, 0], (0, 2)),
        ([], [0, 1], ()),
        ([0], [0], ()),
        ([3], [0, 1], ()),
    ],
    ids=["by number", "by text, in another order", "none given", "only one", "unknown"],
)
def test_an_actor_renders_on_the_gpus_that_ray_has_given_to_it(
    ray: FakeRay, monkeypatch: pytest.MonkeyPatch, given: list[Any], cuda: list[int | None], chosen: tuple[int, ...]
) -> None:
    gpus = tuple(EglDevice(k, "NVIDIA H200", software=False, cuda_index=index) for k, index in enumerate(cuda))
    monkeypatch.setattr(ray_worker, "accessible_gpus", lambda: gpus)
    ray.gpu_ids = given
    assert ray_worker._own_gpus() == chosen
