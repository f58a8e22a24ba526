"""Tracks and futures of a synthetic scene, checked box by box against a search of its actor tables."""

import io
import random
import zipfile
from contextlib import suppress

import numpy as np
import pytest

from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.semantics import BOX_CLASSES
from simbev_ros.foundation.types import Table
from simbev_ros.scene.blueprints import blueprint_index, load_blueprints
from simbev_ros.schema.scene.state import ACTOR_DTYPE, EGO_ID, SIGNAL_DTYPE, WorldState
from simbev_ros.schema.trajectories import TrackRecorder, Tracks, futures, tracks_from_npz, tracks_to_npz
from simbev_ros.simulation.annotation.boxes.boxes import boxes_around_ego, class_of_blueprint

TICK_NS = 50_000_000
START_NS = 7_200_000_000_000
SEDAN = blueprint_index()["vehicle.sedan"]
RIDER = next(row for row, blueprint in enumerate(load_blueprints()) if not blueprint.box_class)
PRESENT = {EGO_ID: (0, 40), 2: (0, 40), 5: (10, 30), 9: (0, 15), 12: (25, 40)}
"""Actor id → first frame, and frame after the last one."""


def table(frame: int, omitted_id: int = 0) -> Table:
    """Actors on separate circles; a rider, which has no class, is in every frame."""
    ids = [number for number, (first, end) in PRESENT.items() if first <= frame < end and number != omitted_id]
    rows = np.zeros(len(ids) + 1, ACTOR_DTYPE)
    rows["id"] = [*ids, 20]
    rows["blueprint"] = [*[SEDAN] * len(ids), RIDER]
    angle = rows["id"] + 0.1 * frame
    rows["x"], rows["y"], rows["z"] = 10.0 * np.cos(angle), 10.0 * np.sin(angle), 0.3 * rows["id"]
    rows["yaw"] = (angle + np.pi / 2 + np.pi) % (2 * np.pi) - np.pi
    rows["roll"], rows["pitch"] = 0.02, -0.1
    rows["vx"], rows["vy"], rows["vz"] = -20.0 * np.sin(angle), 20.0 * np.cos(angle), 0.5
    rows["length"], rows["width"], rows["height"] = 4.0, 2.0, 1.5
    return rows


def scene(*missing: int) -> Tracks:
    frames = ((START_NS + frame * TICK_NS, table(frame)) for frame in range(40) if frame not in missing)
    tracker = TrackRecorder(TICK_NS, class_of_blueprint())
    for stamp_ns, actors in frames:
        tracker.add_frame(stamp_ns, actors)
    return tracker.tracks()


def boxes_at(frame: int) -> Table:
    state = WorldState(START_NS + frame * TICK_NS, frame, EGO_ID, table(frame), np.zeros(0, SIGNAL_DTYPE), None)  # type: ignore[arg-type]
    return boxes_around_ego(state, 500.0)


@pytest.mark.parametrize(("horizon_s", "step_s", "stride"), [(1.0, None, 1), (1.3, 0.25, 5)])
def test_the_future_of_each_box_matches_the_boxes_of_later_frames(
    horizon_s: float, step_s: float | None, stride: int
) -> None:
    tracks = scene()
    later = [{row["id"]: row for row in boxes_at(frame)} for frame in range(40)]
    for frame in range(40):
        now = boxes_at(frame)
        found = futures(tracks, now["id"], np.full(len(now), START_NS + frame * TICK_NS), horizon_s, step_s)
        assert len(found.after_s) == int(horizon_s / (0.05 * stride) + 1e-9)
        assert found.after_s == pytest.approx(0.05 * stride * np.arange(1, len(found.after_s) + 1))
        for number, row in enumerate(now):
            for step in range(len(found.after_s)):
                future_frame = frame + (step + 1) * stride
                future_box = later[future_frame].get(row["id"]) if future_frame < 40 else None
                assert found.valid[number, step] == (future_box is not None)
                position, velocity = found.position_m[number, step], found.velocity_mps[number, step]
                if future_box is None:
                    assert not position.any() and not velocity.any() and found.yaw_rad[number, step] == 0.0
                else:
                    assert position.tolist() == [future_box["x"], future_box["y"], future_box["z"]]
                    assert velocity.tolist() == [future_box["vx"], future_box["vy"], future_box["vz"]]
                    assert found.yaw_rad[number, step] == future_box["yaw"]


def test_steps_and_horizons_count_ticks_of_uneven_length() -> None:
    tracker = TrackRecorder(tick_ns := 16_666_667, class_of_blueprint())
    for frame in range(31):
        tracker.add_frame(START_NS + frame * tick_ns, table(frame))
    found = futures(tracker.tracks(), np.array([2], np.uint32), np.array([START_NS]), 0.5, 0.1)
    assert found.after_s == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5])


def test_tracks_cover_actors_with_a_class_and_mark_when_they_exist() -> None:
    tracks = scene()
    assert tracks.id.tolist() == sorted(PRESENT)
    assert [(int(np.argmax(row)), int(row.sum())) for row in tracks.valid] == [
        (first, end - first) for _, (first, end) in sorted(PRESENT.items())
    ]
    assert [BOX_CLASSES[number] for number in tracks.box_class] == ["car"] * len(PRESENT)
    assert tracks.size_m.tolist() == [[4.0, 2.0, 1.5]] * len(PRESENT)


def test_a_missing_frame_is_invalid_in_the_future() -> None:
    found = futures(scene(8), np.array([2], np.uint32), np.array([START_NS + 5 * TICK_NS]), 0.25)
    assert found.valid.tolist() == [[True, True, False, True, True]]
    assert found.position_m[0, 3].tolist() == scene().position_m[1, 9].tolist()


def test_futures_of_a_batch_of_frames_equal_those_of_each_frame() -> None:
    tracks = scene()
    stamps_ns = START_NS + TICK_NS * np.array([3, 12, 39])
    together = futures(tracks, np.array([2, 5, 12], np.uint32), stamps_ns, 0.5)
    for row, (number, stamp_ns) in enumerate(zip((2, 5, 12), stamps_ns, strict=True)):
        alone = futures(tracks, np.array([number], np.uint32), np.array([stamp_ns]), 0.5)
        assert together.valid[row].tolist() == alone.valid[0].tolist()
        assert together.position_m[row].tolist() == alone.position_m[0].tolist()
    assert not together.valid[2].any()  # after the last frame


def test_the_file_is_complete_and_readable_with_numpy() -> None:
    tracks, file = scene(), tracks_to_npz(scene())
    back = tracks_from_npz(file)
    assert back.tick_ns == TICK_NS
    for name in ("stamp_ns", "id", "box_class", "size_m", "valid", "position_m", "yaw_rad", "velocity_mps"):
        wanted, found = getattr(tracks, name), getattr(back, name)
        assert found.dtype == wanted.dtype and np.array_equal(found, wanted)
    assert tracks_to_npz(back) == file
    with np.load(io.BytesIO(file)) as arrays:
        assert arrays["class_names"][arrays["class"]].tolist() == ["car"] * len(PRESENT)
        assert arrays["position_m"].shape == (len(PRESENT), 40, 3)


def test_the_bytes_do_not_depend_on_a_compressor() -> None:
    with zipfile.ZipFile(io.BytesIO(tracks_to_npz(scene()))) as file:
        assert {member.compress_type for member in file.infolist()} == {zipfile.ZIP_STORED}
        assert {member.date_time for member in file.infolist()} == {(1980, 1, 1, 0, 0, 0)}


def test_compressed_files_of_earlier_versions_are_read() -> None:
    with np.load(io.BytesIO(tracks_to_npz(scene()))) as arrays:
        np.savez_compressed(earlier := io.BytesIO(), **arrays)
    assert len(earlier.getvalue()) < len(tracks_to_npz(scene()))
    assert tracks_to_npz(tracks_from_npz(earlier.getvalue())) == tracks_to_npz(scene())


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04", tracks_to_npz(scene())[:200], b"\x93NUMPY"])
def test_a_damaged_file_is_reported(damage: bytes) -> None:
    with pytest.raises(BagError, match="trajectories are damaged"):
        tracks_from_npz(damage)


def test_flipped_bits_are_reported_or_harmless() -> None:
    file, choice = tracks_to_npz(scene()), random.Random(1)
    for position in (*choice.sample(range(len(file)), 1000), *range(len(file) - 900, len(file))):
        damaged = bytearray(file)
        damaged[position] ^= 1 << choice.randrange(8)
        with suppress(BagError):
            assert tracks_to_npz(tracks_from_npz(bytes(damaged))) == file


@pytest.mark.parametrize(
    ("horizon_s", "step_s", "message"),
    [(6.0, 0.07, "step_s: 0.07 is not a whole number"), (6.0, 0.0, "step_s: 0 is"), (0.2, 0.5, "horizon_s: 0.2 is")],
)
def test_steps_between_frames_are_refused(horizon_s: float, step_s: float, message: str) -> None:
    with pytest.raises(InputError, match=message):
        futures(scene(), np.array([2], np.uint32), np.array([START_NS]), horizon_s, step_s)


def test_an_actor_without_a_track_is_an_error() -> None:
    with pytest.raises(KeyError, match="no track of actor 20"):
        futures(scene(), np.array([2, 20], np.uint32), np.array([START_NS, START_NS]))


def test_an_empty_scene_has_no_tracks() -> None:
    tracks = TrackRecorder(TICK_NS, class_of_blueprint()).tracks()
    assert tracks.position_m.shape == (0, 0, 3)
    assert tracks_from_npz(tracks_to_npz(tracks)).valid.shape == (0, 0)
