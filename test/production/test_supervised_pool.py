"""Pools of several workers: what their messages become, and what happens when a worker is lost."""

from typing import Any

import pytest
from fake_pool import COST
from made_up_scene import made_up_spec

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import GraphError, RenderError
from simbev_ros.production import ProductionObserver
from simbev_ros.production.events import (
    DatasetEnded,
    GraphStarted,
    GraphWarned,
    LeftoverRemoved,
    MapNoted,
    ProductionEvent,
    RegionBuilt,
    SceneEnded,
    SceneProgressed,
    SceneStarted,
    StackEvaluated,
    StepEnded,
    StepStarted,
    SurroundingsEnded,
    SurroundingsStarted,
    WorkerPrepares,
)
from simbev_ros.production.observer import SILENT
from simbev_ros.production.scene_ending import FailedScene, LostScene, MadeScene
from simbev_ros.production.workers.messages import Report, Signal
from simbev_ros.production.workers.supervised_pool import SupervisedPool, WorkerLost
from simbev_ros.production.workers.worker_pool import Worker

ENTRY = PlannedEntry(number=0, map="Blocks", split="train")
MADE = MadeScene({}, "made", {}, COST)
DEAD = WorkerLost("it died")


class FakeHandle:
    """A worker whose messages a test puts into batches; an exception in place of a batch is raised."""

    def __init__(self, name: str, *batches: list[Any] | WorkerLost) -> None:
        self.worker = Worker(name, "here")
        self.batches = list(batches)
        self.calls: list[str] = []

    def submit(self, entry: PlannedEntry) -> None:
        self.calls.append(f"submit {entry.number}")

    def read(self) -> list[Any]:
        batch = self.batches.pop(0) if self.batches else []
        if isinstance(batch, WorkerLost):
            raise batch
        return batch

    def end(self) -> None:
        self.calls.append("end")

    def join(self) -> None:
        self.calls.append("join")

    def kill(self) -> None:
        self.calls.append("kill")


class FakeSupervisedPool(SupervisedPool):
    """Has as many workers as it begins with; those that are lost are replaced by the next ones."""

    def __init__(self, observer: ProductionObserver, first: list[FakeHandle], later: list[FakeHandle]) -> None:
        super().__init__(observer)
        self._wanted, self._left = len(first), [*first, *later]
        self.costs: list[MadeScene] = []

    def _scale(self) -> None:
        while len(self._handles) < self._wanted and self._left:
            self._add_worker(self._left.pop(0))

    def _pause(self, timeout_s: float) -> None:
        pass

    def _record_cost(self, scene: MadeScene) -> None:
        self.costs.append(scene)


class Recorder(ProductionObserver):
    """Keeps the events that pools forward."""

    def __init__(self) -> None:
        self.events: list[ProductionEvent] = []

    def notify(self, event: ProductionEvent) -> None:
        self.events.append(event)


def reports(*events: ProductionEvent) -> list[Any]:
    """The messages of a worker that reports some events."""
    return [Report(event) for event in events]


def fake_pool(
    *first: FakeHandle, later: tuple[FakeHandle, ...] = (), observer: ProductionObserver | None = None
) -> FakeSupervisedPool:
    return FakeSupervisedPool(observer or SILENT, list(first), list(later))


def submit_to_all(pool: SupervisedPool, *numbers: int) -> None:
    """Wait until there are workers for some scenes, and give them out."""
    idle: list[Worker] = []
    while len(idle) < len(numbers):
        assert pool.wait(1.0) == []
        idle = list(pool.idle())
    for worker, number in zip(idle, numbers, strict=True):
        pool.submit(worker, ENTRY.model_copy(update={"number": number}))


def test_a_worker_is_idle_from_when_it_is_ready_to_when_it_is_given_a_scene() -> None:
    handle = FakeHandle("w1", [], [Signal.HEARTBEAT], [Signal.READY], [Signal.HEARTBEAT], [MADE], [Signal.READY])
    with fake_pool(handle) as pool:
        assert not pool.idle()
        submit_to_all(pool, 5)
        assert not pool.idle() and handle.calls == ["submit 5"]
        assert pool.wait(1.0) == [(handle.worker, ENTRY.model_copy(update={"number": 5}), MADE)]
        assert pool.costs == [MADE] and not pool.idle(), "it is not ready yet"
        assert pool.wait(1.0) == [] and pool.idle() == [handle.worker]
    assert handle.calls == ["submit 5", "end", "join"]


def test_scenes_of_several_workers_end_independently() -> None:
    failed = FailedScene(GraphError("world died"))
    first, second = (
        FakeHandle("w1", [Signal.READY], [], [MADE]),
        FakeHandle("w2", [Signal.READY], [failed, Signal.READY]),
    )
    with fake_pool(first, second) as pool:
        submit_to_all(pool, 0, 1)
        assert pool.wait(1.0) == [(second.worker, ENTRY.model_copy(update={"number": 1}), failed)]
        assert pool.idle() == [second.worker]
        assert pool.wait(1.0) == [(first.worker, ENTRY, MADE)]


def test_waiting_has_an_end() -> None:
    with fake_pool(FakeHandle("w1")) as pool:
        assert pool.wait(0.05) == []


def test_steps_of_workers_are_reported_with_their_names() -> None:
    seen = Recorder()
    one = reports(StepStarted("roads of Blocks"), StepEnded())
    other = reports(SurroundingsStarted("Town01", 4), RegionBuilt(), SurroundingsEnded())
    with fake_pool(FakeHandle("w1", one, [Signal.READY]), FakeHandle("w2", other), observer=seen) as pool:
        pool.wait(1.0)
    steps = [("w1", "roads of Blocks"), ("w1", None), ("w2", "surroundings of Town01"), ("w2", None)]
    assert seen.events == [WorkerPrepares(*step) for step in steps]


def test_notes_of_maps_are_reported_once_and_warnings_each_time() -> None:
    seen, notes, warning = (
        Recorder(),
        [MapNoted(name, "no trees") for name in ("Blocks", "Town01")],
        GraphWarned("w", ""),
    )
    batch = reports(*notes, warning)
    with fake_pool(FakeHandle("w1", batch, [Signal.READY]), FakeHandle("w2", batch), observer=seen) as pool:
        pool.wait(1.0)
    assert seen.events == [*notes, warning, warning]


def test_scenes_of_several_workers_are_reported_side_by_side() -> None:
    seen, specs = Recorder(), [made_up_spec([], number=number) for number in (0, 1)]
    kinds = [[SceneStarted(spec), SceneProgressed(spec.name, 7), SceneEnded(spec.name, None)] for spec in specs]
    handles = [
        FakeHandle(f"w{number}", [Signal.READY], *(reports(event) for event in events), [MADE])
        for number, events in enumerate(kinds)
    ]
    with fake_pool(*handles, observer=seen) as pool:
        submit_to_all(pool, 0, 1)
        assert len(pool.wait(1.0)) == 2
    assert seen.events == [event for pair in zip(*kinds, strict=True) for event in pair]


def test_events_of_a_single_graph_are_dropped_and_those_of_a_driver_are_a_fault() -> None:
    seen, dropped = Recorder(), reports(GraphStarted(4, {}), StackEvaluated({}), LeftoverRemoved("Blocks-0000"))
    with fake_pool(FakeHandle("w1", dropped, [Signal.READY]), observer=seen) as pool:
        pool.wait(1.0)
    assert seen.events == []
    with (
        pytest.raises(AssertionError, match=r"^w1 has sent an event of the driver: DatasetEnded"),
        fake_pool(FakeHandle("w1", reports(DatasetEnded()))) as pool,
    ):
        pool.wait(1.0)


def test_a_worker_that_dies_is_killed_and_replaced_and_its_scene_is_lost() -> None:
    seen, spec = Recorder(), made_up_spec([])
    dying = FakeHandle("w1", [Signal.READY], reports(SceneStarted(spec)), DEAD)
    heir = FakeHandle("w2", [Signal.READY])
    with fake_pool(dying, later=(heir,), observer=seen) as pool:
        submit_to_all(pool, 0)
        assert pool.wait(1.0) == [(dying.worker, ENTRY, LostScene("it died"))]
        assert dying.calls == ["submit 0", "kill"] and not pool.idle()
        assert pool.wait(1.0) == [] and pool.idle() == [heir.worker]
    assert seen.events == [SceneStarted(spec), WorkerPrepares("w1", None), SceneEnded(spec.name, None)]
    assert heir.calls == ["end", "join"]


def test_a_scene_that_ended_before_its_worker_died_is_not_ended_again() -> None:
    seen, spec = Recorder(), made_up_spec([])
    played = reports(SceneStarted(spec), SceneEnded(spec.name, None))
    with fake_pool(FakeHandle("w1", [Signal.READY], [*played, MADE], DEAD), observer=seen) as pool:
        submit_to_all(pool, 0)
        assert len(pool.wait(1.0)) == 1
        assert pool.wait(0.05) == []
    assert seen.events == [SceneStarted(spec), SceneEnded(spec.name, None), WorkerPrepares("w1", None)]


def test_an_idle_worker_that_dies_loses_no_scene() -> None:
    with fake_pool(FakeHandle("w1", [Signal.READY], DEAD)) as pool:
        pool.wait(1.0)
        assert pool.wait(0.05) == [] and not pool.idle()


def test_three_workers_that_are_lost_as_they_start_end_production() -> None:
    dying = [FakeHandle(f"w{k}", [Signal.HEARTBEAT], WorkerLost(f"w{k} died: 1")) for k in range(3)]
    with (
        pytest.raises(GraphError, match=r"^3 workers were lost as they started; the last one: w2 died: 1$"),
        fake_pool(dying[0], later=tuple(dying[1:])) as pool,
    ):
        pool.wait(1.0)
    assert all(handle.calls == ["kill"] for handle in dying)


def test_a_worker_that_was_ready_resets_the_count_of_lost_starts() -> None:
    dying = [FakeHandle(f"w{k}", DEAD) for k in range(2)]
    more = [FakeHandle("ready", [Signal.READY], DEAD), *(FakeHandle(f"v{k}", DEAD) for k in range(2))]
    with fake_pool(dying[0], later=(dying[1], *more)) as pool:
        pool.wait(1.0)
        assert pool.wait(0.05) == [] and all(handle.calls == ["kill"] for handle in (*dying, *more))


def test_an_error_of_a_worker_that_cannot_start_is_raised_and_the_others_are_ended() -> None:
    other = FakeHandle("w2")
    with (
        pytest.raises(RenderError, match=r"^no GPU$"),
        fake_pool(FakeHandle("w1", [RenderError("no GPU")]), other) as pool,
    ):
        pool.wait(1.0)
    assert other.calls == ["end", "join"]
