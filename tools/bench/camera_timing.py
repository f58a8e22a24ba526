"""Times the cameras of a rig: a frame at each quality, the parts of it, and another renderer for comparison."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from statistics import median

from simbev_ros.assets.actors.catalog import load_models
from simbev_ros.config.camera import Camera
from simbev_ros.config.rendering import Quality, Rendering
from simbev_ros.foundation.process_memory import keep_freed_memory
from simbev_ros.simulation.render.frame import CameraView
from simbev_ros.simulation.render.gl.context import describe_context, open_context
from simbev_ros.simulation.render.gl.timer import PartClock
from simbev_ros.simulation.render.renderer import Renderer
from tools.bench.camera_scene import CameraScene
from tools.bench.camera_team import CameraTeam, Painter, moments
from tools.bench.mujoco_scene import has_mujoco


@dataclass(frozen=True, slots=True)
class Cost:
    """Wall time and processor time of all threads per frame of the whole rig."""

    name: str
    wall_ms: float
    cpu_ms: float


@dataclass(frozen=True, slots=True)
class QualityTiming:
    """One quality: a whole frame, and its parts, which were timed one by one in other frames and a single process."""

    quality: Quality
    total: Cost
    parts: list[Cost]


@dataclass(frozen=True, slots=True)
class Comparison:
    """Another renderer on the same triangles, cameras and machine, right after ours.

    Attributes:
        version: Version of MuJoCo.
        total: Time for color, depth and segmentation, without flow, with the same number of processes.
        wall_ratio: Its wall time over ours at medium quality, or at the first quality; above 1 ours is faster.
        cpu_ratio: The same ratio for processor time.
    """

    version: str
    total: Cost
    wall_ratio: float
    cpu_ratio: float


@dataclass(frozen=True, slots=True)
class CameraTiming:
    """The scene, the cameras and their times; ``mujoco`` is None if that package is not installed."""

    renderer: str
    processes: int
    map: str
    actors: int
    triangles: int
    cameras: int
    width_px: int
    height_px: int
    frames: int
    qualities: list[QualityTiming]
    mujoco: Comparison | None

    def title(self) -> str:
        """One line on the scene and the cameras."""
        return (
            f"{self.cameras} cameras of {self.width_px} x {self.height_px} on {self.map}, {self.actors} actors, "
            f"{self.triangles:,} triangles; {self.processes} "
            f"{'process' if self.processes == 1 else 'processes'}; {self.renderer}"
        )

    def rows(self) -> list[tuple[str, ...]]:
        """Rows of a table: quality, part, wall time and processor time per frame in ms."""
        costs = [
            (timing.quality if cost is timing.total else "", cost)
            for timing in self.qualities
            for cost in (timing.total, *timing.parts)
        ]
        if self.mujoco is not None:
            costs.append(("", self.mujoco.total))
        return [(quality, cost.name, f"{cost.wall_ms:.1f}", f"{cost.cpu_ms:.1f}") for quality, cost in costs]

    def comparison(self) -> str:
        """A sentence on the ratios to MuJoCo."""
        if self.mujoco is None:
            return "To compare with another renderer: pip install mujoco"
        return (
            f"MuJoCo {self.mujoco.version}, the same triangles, cameras and number of processes: "
            f"{self.mujoco.wall_ratio:.2f} times our time, {self.mujoco.cpu_ratio:.2f} times our CPU time; "
            "flat colors, depth and segmentation in three passes; no sky, textures, occlusion, anti-aliasing or flow"
        )


def steps(scene: CameraScene, qualities: Sequence[Quality]) -> int:
    """Number of frames that ``timed_cameras`` draws."""
    return len(moments(scene)) * (2 * len(qualities) + has_mujoco())


def timed_cameras(
    scene: CameraScene,
    cameras: Sequence[Camera],
    size_px: tuple[int, int],
    qualities: Sequence[Quality],
    rendering: Rendering,
    progress: Callable[[], None] = lambda: None,
) -> CameraTiming:
    """Draw the moments of a scene with all cameras, read the images back, and take the median of the times.

    Args:
        scene: At least three moments: one before the first frame, one for warm-up, and those to time.
        cameras: Their poses and modalities.
        size_px: Width and height of every image.
        qualities: The qualities to time, one after the other.
        rendering: The number of processes that share the cameras, and their devices.
        progress: Called after each frame.

    Raises:
        RenderError: OpenGL is not usable here.
        SimbevError: A process was killed.
    """
    width_px, height_px = size_px
    size = {"width_px": width_px, "height_px": height_px}
    sized = [Camera.model_validate({**camera.model_dump(), **size}) for camera in cameras]
    views = [CameraView.from_config(camera, seed=0, tick=0) for camera in sized]
    keep_freed_memory()
    context = open_context(rendering.device_of(0))
    name = describe_context(context)
    context.release()
    with CameraTeam(scene, views, rendering) as team:
        totals = [_total(team, quality, scene, progress) for quality in qualities]
        rival = _total(team, "MuJoCo", scene, progress) if has_mujoco() else None
    parts = [_parts(scene, views, quality, rendering, progress) for quality in qualities]
    timings = [QualityTiming(*timing) for timing in zip(qualities, totals, parts, strict=True)]
    state = scene.states[-1]
    return CameraTiming(
        renderer=name,
        processes=team.processes,
        map=scene.map,
        actors=len(state.actors),
        triangles=_triangles(scene),
        cameras=len(views),
        width_px=width_px,
        height_px=height_px,
        frames=len(moments(scene)) - 1,
        qualities=timings,
        mujoco=None if rival is None else _compared(rival, timings),
    )


def _total(team: CameraTeam, painter: Painter, scene: CameraScene, progress: Callable[[], None]) -> Cost:
    """Time of a frame, from the common start until the last process has all its images."""
    team.prepare(painter)
    costs = []
    for moment in range(len(moments(scene))):
        wall_s, cpu_s = team.draw(moment)
        costs.append(Cost("total", 1000.0 * wall_s, 1000.0 * cpu_s))
        progress()
    return _median("MuJoCo" if painter == "MuJoCo" else "total", costs[1:])


def _parts(
    scene: CameraScene,
    views: Sequence[CameraView],
    quality: Quality,
    rendering: Rendering,
    progress: Callable[[], None],
) -> list[Cost]:
    """Times of the parts of a frame that this process draws alone."""
    context = open_context(rendering.device_of(0))
    clock = PartClock(context)
    renderer = Renderer(scene.static, load_models(), context, quality, timer=clock)
    renderer.set_lights(scene.lights)
    clock.is_on = True
    parts = []
    for frame in moments(scene):
        whole = _timed("total", partial(renderer.render, views, frame), progress)
        costs = [Cost(part, *cost_ms) for part, cost_ms in clock.take().items()]
        rest = Cost("rest", whole.wall_ms - sum(c.wall_ms for c in costs), whole.cpu_ms - sum(c.cpu_ms for c in costs))
        parts.append([*costs, rest])
    renderer.close()
    names = dict.fromkeys(cost.name for costs in parts[1:] for cost in costs)
    return [_median(name, [cost for costs in parts[1:] for cost in costs if cost.name == name]) for name in names]


def _compared(rival: Cost, timings: Sequence[QualityTiming]) -> Comparison:
    """Compare MuJoCo's renderer with our medium quality, or else the first one."""
    ours = next((timing for timing in timings if timing.quality == "medium"), timings[0]).total
    return Comparison(version("mujoco"), rival, rival.wall_ms / ours.wall_ms, rival.cpu_ms / ours.cpu_ms)


def _timed(name: str, draw: Callable[[], object], progress: Callable[[], None]) -> Cost:
    wall_s, cpu_s = time.perf_counter(), time.process_time()
    draw()
    cost = Cost(name, 1000.0 * (time.perf_counter() - wall_s), 1000.0 * (time.process_time() - cpu_s))
    progress()
    return cost


def _median(name: str, costs: Sequence[Cost]) -> Cost:
    return Cost(name, median(cost.wall_ms for cost in costs), median(cost.cpu_ms for cost in costs))


def _triangles(scene: CameraScene) -> int:
    """Number of triangles of the static scene and of the actors at the last moment."""
    models, blueprints = load_models(), scene.states[-1].actors["blueprint"]
    of_actors = sum(len(models[blueprint].mesh.triangles) for blueprint in blueprints)
    return of_actors + sum(len(tile.mesh.triangles) for tile in scene.static.tiles)
