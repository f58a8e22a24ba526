"""Teams of workers: what their messages become, and what happens when a worker is lost."""

from collections.abc import Callable
from typing import Any

import pytest
from fake_pool import COST
from made_up_scene import made_up_spec

from simbev_ros.dataset.plan import PlannedEntry
from simbev_ros.foundation.errors import GraphError, RenderError
from simbev_ros.production import ProductionObserver
from simbev_ros.production.scene_ending import FailedScene, LostScene, MadeScene
from simbev_ros.production.workers.messages import ReportingObserver, Sign
from simbev_ros.production.workers.supervised_pool import SupervisedPool, WorkerLost
from simbev_ros.production.workers.worker_pool import Worker
from simbev_ros.scene.ending import SceneEnd
from simbev_ros.schema.scene.spec import SceneSpec

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


class Diary(ProductionObserver):
    """Writes down the events that teams pass on."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def step_started(self, step: str) -> None:
        self.lines.append("a step of the driver's own process")

    def surroundings_started(self, map_name: str, regions: int) -> None:
        self.lines.append("surroundings in the driver's own process")

    def map_noted(self, map_name: str, note: str) -> None:
        self.lines.append(f"{map_name}: {note}")

    def worker_prepares(self, worker: str, step: str | None) -> None:
        self.lines.append(f"{worker} {step}")

    def scene_started(self, spec: SceneSpec) -> None:
        self.lines.append(f"start {spec.number}")

    def scene_progressed(self, spec: SceneSpec, tick: int | None) -> None:
        self.lines.append(f"{spec.number} at {tick}")

    def scene_ended(self, spec: SceneSpec, end: SceneEnd | None) -> None:
        self.lines.append(f"end {spec.number} {end and end.reason}")

    def graph_warned(self, node: str, message: str) -> None:
        self.lines.append(f"{node}: {message}")


def reports(*calls: Callable[[ProductionObserver], None]) -> list[Any]:
    """The messages of a worker whose production makes some calls to its observer."""
    sent: list[Any] = []
    observer = ReportingObserver(sent.append)
    for call in calls:
        call(observer)
    return sent


def fake_pool(
    *first: FakeHandle, later: tuple[FakeHandle, ...] = (), observer: ProductionObserver | None = None
) -> FakeSupervisedPool:
    return FakeSupervisedPool(observer or ProductionObserver(), list(first), list(later))


def submit_to_all(pool: SupervisedPool, *numbers: int) -> None:
    """Wait until there are workers for some scenes, and give them out."""
    idle: list[Worker] = []
    while len(idle) < len(numbers):
        assert pool.wait(1.0) == []
        idle = list(pool.idle())
    for worker, number in zip(idle, numbers, strict=True):
        pool.submit(worker, ENTRY.model_copy(update={"number": number}))


def test_a_worker_is_idle_from_when_it_is_ready_to_when_it_is_given_a_scene() -> None:
    handle = FakeHandle("w1", [], [Sign.ALIVE], [Sign.READY], [Sign.ALIVE], [MADE], [Sign.READY])
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
    first, second = FakeHandle("w1", [Sign.READY], [], [MADE]), FakeHandle("w2", [Sign.READY], [failed, Sign.READY])
    with fake_pool(first, second) as pool:
        submit_to_all(pool, 0, 1)
        assert pool.wait(1.0) == [(second.worker, ENTRY.model_copy(update={"number": 1}), failed)]
        assert pool.idle() == [second.worker]
        assert pool.wait(1.0) == [(first.worker, ENTRY, MADE)]


def test_waiting_has_an_end() -> None:
    with fake_pool(FakeHandle("w1")) as pool:
        assert pool.wait(0.05) == []


def test_steps_of_workers_are_reported_with_their_names() -> None:
    diary = Diary()
    one = reports(lambda to: to.step_started("roads of Blocks"), lambda to: to.step_ended())
    other = reports(
        lambda to: to.surroundings_started("Town01", 4),
        lambda to: to.region_built(),
        lambda to: to.surroundings_ended(),
    )
    with fake_pool(FakeHandle("w1", one, [Sign.READY]), FakeHandle("w2", other), observer=diary) as pool:
        pool.wait(1.0)
    assert diary.lines == ["w1 roads of Blocks", "w1 None", "w2 surroundings of Town01", "w2 None"]


def test_notes_of_maps_are_reported_once_and_warnings_each_time() -> None:
    diary = Diary()
    batch = reports(
        lambda to: to.map_noted("Blocks", "no trees"),
        lambda to: to.map_noted("Town01", "no trees"),
        lambda to: to.graph_warned("world", "slow"),
    )
    with fake_pool(FakeHandle("w1", batch, [Sign.READY]), FakeHandle("w2", batch), observer=diary) as pool:
        pool.wait(1.0)
    assert diary.lines == ["Blocks: no trees", "Town01: no trees", "world: slow", "world: slow"]


def test_progress_names_the_scene_of_the_worker_that_reports() -> None:
    diary = Diary()
    specs = [made_up_spec([], number=number) for number in (0, 1)]
    handles = []
    for number, spec in enumerate(specs):
        calls = reports(
            lambda to, spec=spec: to.scene_started(spec),  # type: ignore[misc]
            lambda to, spec=spec: to.scene_progressed(spec, 7),  # type: ignore[misc]
            lambda to, spec=spec: to.scene_ended(spec, None),  # type: ignore[misc]
        )
        handles.append(FakeHandle(f"w{number}", [Sign.READY], *([call] for call in calls), [MADE]))
    with fake_pool(*handles, observer=diary) as pool:
        submit_to_all(pool, 0, 1)
        assert len(pool.wait(1.0)) == 2
    assert diary.lines == ["start 0", "start 1", "0 at 7", "1 at 7", "end 0 None", "end 1 None"]


def test_a_worker_that_dies_is_killed_and_replaced_and_its_scene_is_lost() -> None:
    diary, spec = Diary(), made_up_spec([])
    dying = FakeHandle("w1", [Sign.READY], reports(lambda to: to.scene_started(spec)), DEAD)
    heir = FakeHandle("w2", [Sign.READY])
    with fake_pool(dying, later=(heir,), observer=diary) as pool:
        submit_to_all(pool, 0)
        assert pool.wait(1.0) == [(dying.worker, ENTRY, LostScene("it died"))]
        assert dying.calls == ["submit 0", "kill"] and not pool.idle()
        assert pool.wait(1.0) == [] and pool.idle() == [heir.worker]
    assert diary.lines == ["start 0", "w1 None", "end 0 None"]
    assert heir.calls == ["end", "join"]


def test_a_scene_that_ended_before_its_worker_died_is_not_ended_again() -> None:
    diary, spec = Diary(), made_up_spec([])
    played = reports(lambda to: to.scene_started(spec), lambda to: to.scene_ended(spec, None))
    with fake_pool(FakeHandle("w1", [Sign.READY], [*played, MADE], DEAD), observer=diary) as pool:
        submit_to_all(pool, 0)
        assert len(pool.wait(1.0)) == 1
        assert pool.wait(0.05) == []
    assert diary.lines == ["start 0", "end 0 None", "w1 None"]


def test_an_idle_worker_that_dies_loses_no_scene() -> None:
    with fake_pool(FakeHandle("w1", [Sign.READY], DEAD)) as pool:
        pool.wait(1.0)
        assert pool.wait(0.05) == [] and not pool.idle()


def test_three_workers_that_are_lost_as_they_start_end_production() -> None:
    dying = [FakeHandle(f"w{k}", [Sign.ALIVE], WorkerLost(f"w{k} died: 1")) for k in range(3)]
    with (
        pytest.raises(GraphError, match=r"^3 workers were lost as they started; the last one: w2 died: 1$"),
        fake_pool(dying[0], later=tuple(dying[1:])) as pool,
    ):
        pool.wait(1.0)
    assert all(handle.calls == ["kill"] for handle in dying)


def test_a_worker_that_was_ready_resets_the_count_of_lost_starts() -> None:
    dying = [FakeHandle(f"w{k}", DEAD) for k in range(2)]
    more = [FakeHandle("ready", [Sign.READY], DEAD), *(FakeHandle(f"v{k}", DEAD) for k in range(2))]
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
