from pathlib import Path

import av
import cv2
import numpy as np
import pytest
from synthetic_scene import STEP_M, camera_images, write_scene

from simbev_ros.cli.preview import preview
from simbev_ros.dataset import open_dataset
from simbev_ros.foundation.errors import BagError, InputError
from simbev_ros.foundation.types import UInt8Array
from simbev_ros.recording.reader import SceneBag
from simbev_ros.show.sheet import LabelPlacement
from simbev_ros.show.sheet.contact_sheet import Captions, ContactSheet
from simbev_ros.show.sheet.frames import FrameReader
from simbev_ros.show.sheet.sheet_panels import LABEL_PANEL
from simbev_ros.show.sheet.views import find_views

FRONT, LIDAR, BEV = "cam_front/rgb", "lidar/semantic_points", "bev/labels"


@pytest.fixture(scope="module")
def bag_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_scene(tmp_path_factory.mktemp("bag") / "Town01-0007")


@pytest.fixture(scope="module")
def labelled_path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """With boxes and the ego's pose."""
    folder = tmp_path_factory.mktemp("labelled")
    return write_scene(folder / "Town01-0007", ticks=2, width_px=160, cameras=("front", "back"), boxes=True)


def draw(path: Path, width_px: int = 960, labels: LabelPlacement = "panel") -> tuple[ContactSheet, UInt8Array]:
    [scene] = open_dataset(path).scenes
    reader = FrameReader(scene, find_views(scene, labels))
    captions = Captions(scene.bag_name, "", len(reader.ticks), scene.spec.start_ns)
    sheet = ContactSheet(reader.views, reader.aspects(), captions, width_px=width_px)
    return sheet, sheet.draw(next(reader.frames(1, 1)))


def test_every_panel_of_the_full_rig_shows_something_of_its_own(bag_path: Path) -> None:
    sheet, picture = draw(bag_path)
    assert picture.shape[1::-1] == sheet.size_px
    assert sheet.size_px[0] == 960 and sheet.size_px[1] % 2 == 0
    boxes = list(sheet.boxes.values())
    assert len(boxes) == 12
    panels = [picture[b.top : b.top + b.height, b.left : b.left + b.width][30:] for b in boxes]
    for panel in panels:
        assert len(np.unique(panel.reshape(-1, 3), axis=0)) > 20
    covered = np.zeros(picture.shape[:2], int)
    for b in boxes:
        covered[b.top : b.top + b.height, b.left : b.left + b.width] += 1
    assert covered.max() == 1


@pytest.mark.parametrize(
    ("cameras", "modalities", "from_above", "tiles"),
    [
        (("front",), ("rgb",), False, 1),
        (("front",), ("rgb", "depth"), True, 4),
        (("front", "back"), ("rgb", "semantic", "flow"), True, 6),
        ((), (), True, 2),
        (("front_left", "front", "front_right", "back"), ("rgb",), False, 4),
    ],
)
def test_smaller_rigs_fill_the_same_width(
    tmp_path: Path, cameras: tuple[str, ...], modalities: tuple[str, ...], from_above: bool, tiles: int
) -> None:
    path = write_scene(
        tmp_path / "a",
        cameras=cameras,
        modalities=modalities,
        from_above=from_above,
        compressed=False,
        ticks=2,
        width_px=32,
    )
    sheet, _ = draw(path, 480)
    boxes = list(sheet.boxes.values())
    assert len(boxes) == tiles
    assert max(b.left + b.width for b in boxes) == pytest.approx(480 - 6, abs=1)


def test_all_radars_of_the_scenes_rig_share_a_panel(tmp_path: Path) -> None:
    path = write_scene(tmp_path / "a", ticks=2, width_px=32, radars=("front", "back"))
    views = find_views(open_dataset(path).scenes[0])
    assert list(views.radars) == ["radar_front/points", "radar_back/points"]
    assert views.radars["radar_back/points"][:2] == pytest.approx(np.array([[-1, 0, 0, -2.4], [0, -1, 0, 0]]))
    sheet, picture = draw(path)
    assert len(sheet.boxes) == 13
    box = sheet.boxes["radar_front/points"]
    panel = picture[box.top : box.top + box.height, box.left : box.left + box.width].astype(int)
    blue, red = panel[..., 2] - panel[..., 0] > 60, panel[..., 0] - panel[..., 2] > 60
    assert min(blue.sum(), red.sum()) > 50
    assert np.argwhere(blue)[:, 0].mean() < 0.45 * box.height, "what is ahead approaches, and is above"
    assert np.argwhere(red)[:, 0].mean() > 0.55 * box.height


def panel(sheet: ContactSheet, picture: UInt8Array, place: str) -> UInt8Array:
    box = sheet.boxes[place]
    return picture[box.top : box.top + box.height, box.left : box.left + box.width]


def test_labels_have_a_panel_of_their_own_and_leave_the_cameras_clean(labelled_path: Path) -> None:
    plain, clean = draw(labelled_path, labels="off")
    sheet, picture = draw(labelled_path)
    assert set(sheet.boxes) == {*plain.boxes, LABEL_PANEL}
    assert (panel(sheet, picture, FRONT) == panel(plain, clean, FRONT)).all()
    labels = panel(sheet, picture, LABEL_PANEL).astype(int)
    assert (labels[..., 2] - labels[..., 0] > 90).sum() > 50, "cars have blue boxes"


def test_labels_over_all_cameras_are_where_what_they_name_is(labelled_path: Path) -> None:
    plain, clean = draw(labelled_path, width_px=1024, labels="off")
    sheet, picture = draw(labelled_path, width_px=1024, labels="cameras")
    assert sheet.boxes == plain.boxes
    for place in (FRONT, FRONT.replace("front", "back"), LIDAR, BEV):
        assert (panel(sheet, picture, place) != panel(plain, clean, place)).any()
    ids = camera_images(STEP_M, 0, 160)["instance"]  # frame 1
    rows, columns = np.nonzero(ids == 2)  # the car ahead
    was, now = (panel(s, p, FRONT).astype(int) for s, p in ((plain, clean), (sheet, picture)))
    scale = was.shape[1] / 160
    bluer = np.argwhere((now - was)[..., 2] - (now - was)[..., 0] > 40) / scale
    around = (bluer > [rows.min() - 3, columns.min() - 3]) & (bluer < [rows.max() + 4, columns.max() + 4])
    assert around.all(axis=1).sum() > 50


def test_images_of_another_size_than_the_rigs_camera_are_refused_with_labels_only(
    labelled_path: Path, tmp_path: Path
) -> None:
    with SceneBag(labelled_path) as bag:
        attachments = {"scene.json": bag.attachments["scene.json"]}
    path = write_scene(tmp_path / "a", ticks=2, width_px=64, cameras=("front",), boxes=True, attachments=attachments)
    with pytest.raises(BagError, match=r"cam_front/rgb.*64.*160.*without labels"):
        draw(path)
    draw(path, labels="off")


def test_preview_writes_a_picture_and_a_video_of_all_frames(bag_path: Path, tmp_path: Path) -> None:
    preview(bag_path, out=tmp_path / "new" / "folder")
    picture = cv2.imread(str(tmp_path / "new" / "folder" / "Town01-0007.png"))
    assert picture is not None and picture.shape[1] == 1920
    with av.open(str(tmp_path / "new" / "folder" / "Town01-0007.mp4")) as container:
        (stream,) = container.streams.video
        assert (stream.codec_context.name, stream.codec_context.pix_fmt) == ("h264", "yuv420p")
        assert (stream.codec_context.width, float(stream.average_rate or 0)) == (1280, 20.0)
        frames = [frame.to_ndarray(format="rgb24").astype(int) for frame in container.decode(video=0)]
    assert len(frames) == 3
    assert sorted(path.name for path in (tmp_path / "new" / "folder").iterdir()) == [
        "Town01-0007.mp4",
        "Town01-0007.png",
    ]
    small = cv2.resize(picture[..., ::-1], frames[0].shape[1::-1], interpolation=cv2.INTER_AREA).astype(int)
    assert np.abs(frames[1] - small).mean() < 6


def test_preview_refuses_to_overwrite_unless_told_to(bag_path: Path, tmp_path: Path) -> None:
    picture = tmp_path / "Town01-0007.png"
    picture.write_text("precious")
    with pytest.raises(InputError, match=r"Town01-0007\.png: exists already; nothing was overwritten"):
        preview(bag_path, out=tmp_path, video=False)
    assert picture.read_text() == "precious"
    preview(bag_path, out=tmp_path, video=False, overwrite=True)
    assert picture.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("frame", [-1, 3])
def test_preview_refuses_a_frame_that_is_not_there(bag_path: Path, tmp_path: Path, frame: int) -> None:
    with pytest.raises(InputError, match=f"--frame {frame}: Town01-0007 has frames 0 to 2"):
        preview(bag_path, out=tmp_path, frame=frame)
    assert not list(tmp_path.iterdir())
