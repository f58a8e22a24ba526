"""Lays the views of a scene out: cameras by the rig's arrangement, 3D, bird's-eye view, plots, map and table."""

from collections.abc import Iterable, Sequence
from typing import Any

import rerun.blueprint as rrb

from simbev_ros.config.camera import Camera
from simbev_ros.show.rerun import ground, plots
from simbev_ros.show.rerun.camera_layers import LAYERS
from simbev_ros.show.rerun.clouds import COLORINGS, FIRST_COLORING
from simbev_ros.show.rerun.scene_log import EGO, TIME, WORLD
from simbev_ros.show.rerun.scene_sheet import SHEET
from simbev_ros.show.rerun.subject import Subject

_FRONT_DEG = 90.0
_EYE_M = (-16.0, 0.0, 9.0)
_LOOK_AT_M = (10.0, 0.0, 0.0)
_HIDDEN = rrb.EntityBehavior(visible=False)
_BACKGROUND = (22, 24, 28)


def scene_blueprint(subject: Subject, *, with_predictions: bool = False, is_live: bool = False) -> rrb.Blueprint:
    """Layout for a scene.

    Args:
        subject: The scene.
        with_predictions: Whether a perception stack's bird's-eye view is shown next to the truth.
        is_live: Whether a running graph is shown, of which the speed is known.
    """
    ground_views = [_ground_view("Bird's-eye view", ground.TRUTH)]
    if with_predictions:
        ground_views.append(_ground_view("Predicted view", ground.PREDICTION))
    facts = _facts_tabs(subject, is_live=is_live)
    below = rrb.Horizontal(*ground_views, facts, column_shares=[*([1.0] * len(ground_views)), 3.5])
    cameras, world = _camera_tabs(subject, LAYERS if subject.detail.layers else ()), _world_view(subject)
    above = rrb.Horizontal(cameras, world, column_shares=[1.5, 1.0]) if cameras else world
    return rrb.Blueprint(
        rrb.Vertical(above, below, row_shares=[1.6, 1.0]),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIME, play_state="playing", loop_mode="all"),
        auto_views=False,
    )


def rows_of_cameras(cameras: Sequence[Camera]) -> list[list[str]]:
    """Names of cameras as one sees them from the driver's seat: those ahead above those behind, from left to right."""
    ordered = sorted(cameras, key=lambda camera: -_side_deg(camera.pose.yaw_deg))
    ahead = [camera.name for camera in ordered if abs(_wrapped_deg(camera.pose.yaw_deg)) <= _FRONT_DEG]
    behind = [camera.name for camera in ordered if camera.name not in ahead]
    return [row for row in (ahead, behind) if row]


def _wrapped_deg(angle_deg: float) -> float:
    return (angle_deg + 180.0) % 360.0 - 180.0


def _side_deg(yaw_deg: float) -> float:
    """Angle to the left of straight ahead, or of straight behind for cameras that look back; -90 to 90."""
    yaw_deg = _wrapped_deg(yaw_deg)
    if abs(yaw_deg) <= _FRONT_DEG:
        return yaw_deg
    return 180.0 - yaw_deg if yaw_deg > 0 else -180.0 - yaw_deg


def _camera_tabs(subject: Subject, layers: Iterable[str]) -> rrb.Tabs | None:
    """A tab for the colors and each layer, with all cameras that have it."""
    cameras = [sensor for sensor in subject.view.rig.sensors if isinstance(sensor, Camera)]
    tabs = []
    for modality in ("rgb", *layers):
        rows = rows_of_cameras([camera for camera in cameras if modality in camera.modalities])
        if rows:
            views = [[_camera_view(name, modality) for name in row] for row in rows]
            title = {"rgb": "Color"}.get(modality, modality.capitalize())
            tabs.append(rrb.Vertical(*_columns_of(views), name=title))
    return rrb.Tabs(*tabs, name="Cameras", active_tab=0) if tabs else None


def _columns_of(rows: Sequence[Sequence[rrb.View]]) -> list[rrb.Container | rrb.View]:
    return [rrb.Horizontal(*row) if len(row) > 1 else row[0] for row in rows]


def _camera_view(name: str, modality: str) -> rrb.Spatial2DView:
    entity = f"{EGO}/{name}"
    return rrb.Spatial2DView(
        origin=entity,
        contents=[f"{entity}/{modality}", f"{entity}/boxes/**"],
        name=name.removeprefix("cam_").replace("_", " "),
        background=_BACKGROUND,
        overrides={} if modality in ("rgb", "depth") else {f"{entity}/boxes": _HIDDEN},
    )


def _world_view(subject: Subject) -> rrb.Spatial3DView:
    excluded = [
        f"- {EGO}/{sensor.name}/{entity}"
        for sensor in subject.sensors("camera")
        for entity in ("rgb", *LAYERS, "boxes/**")
    ]
    return rrb.Spatial3DView(
        origin=EGO,
        contents=[f"+ {WORLD}/**", *excluded],
        name="3D",
        background=_BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            kind=rrb.Eye3DKind.Orbital, position=_EYE_M, look_target=_LOOK_AT_M, eye_up=(0.0, 0.0, 1.0)
        ),
        overrides=_hidden_in_3d(subject),
    )


def _hidden_in_3d(subject: Subject) -> dict[Any, Any]:
    """Entities that are off until they are switched on: colorings of lidar points but one, and occupancy."""
    lidars = [f"{EGO}/{sensor.name}" for sensor in subject.sensors("lidar")]
    hidden = [f"{lidar}/{coloring}" for lidar in lidars for coloring in COLORINGS if coloring != FIRST_COLORING]
    return dict.fromkeys([*hidden, f"{EGO}/occupancy"], _HIDDEN)


def _ground_view(title: str, entity: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=entity, name=title, background=_BACKGROUND, overrides={f"{entity}/classes": _HIDDEN}
    )


def _facts_tabs(subject: Subject, *, is_live: bool) -> rrb.Tabs:
    views: list[rrb.View | rrb.Container] = [
        rrb.Horizontal(
            _plot(plots.SPEED, "Speed, m/s", legend=False),
            _plot(plots.ACCELERATION, "Specific force, m/s²"),
            _plot(plots.TURN_RATE, "Turn rate, rad/s"),
            name="Motion",
        ),
        _plot(plots.BOX_COUNTS, "Boxes"),
    ]
    if is_live:
        views.append(_plot(plots.TICK_RATE, "Ticks/s", legend=False))
    if subject.sensors("gnss"):
        views.append(rrb.MapView(origin=plots.GNSS, name="GNSS", zoom=18.0))
    views += [
        rrb.TextDocumentView(origin=SHEET, name="Scene"),
        rrb.TextLogView(origin=plots.EVENTS, name="Events"),
    ]
    return rrb.Tabs(*views, name="Facts", active_tab=0)


def _plot(origin: str, title: str, *, legend: bool = True) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        origin=origin,
        name=title,
        plot_legend=rrb.PlotLegend(visible=legend, corner=rrb.Corner2D.LeftTop),
    )
