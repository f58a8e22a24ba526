"""Reports in the name of a node of the graph need its signature; those of outside participants do not."""

import pytest

from simbev_ros.ros.msgs.signing import Signer
from simbev_ros.ros.msgs.stamps import header
from simbev_ros.ros.nodes.reports import Report, read_report, report_message

LIDAR = Report("lidar", "Blocks-0000", 1_000_000_050)


def test_a_report_comes_back() -> None:
    for signer in (Signer("key"), Signer(None)):
        assert read_report(report_message(LIDAR, signer), signer, ()) == LIDAR
    assert report_message(LIDAR, Signer(None)).frame_id == "lidar:Blocks-0000"


def test_a_report_of_another_tick_scene_or_node_needs_another_signature() -> None:
    signer = Signer("key")
    signature = report_message(LIDAR, signer).frame_id.rpartition(":")[2]
    for forged in (
        header(LIDAR.stamp_ns + 1, f"lidar:Blocks-0000:{signature}"),
        header(LIDAR.stamp_ns, f"lidar:Blocks-0001:{signature}"),
        header(LIDAR.stamp_ns, f"radar:Blocks-0000:{signature}"),
        header(LIDAR.stamp_ns, "lidar:Blocks-0000"),
        report_message(LIDAR, Signer("another key")),
    ):
        with pytest.raises(ValueError, match=r"'(lidar|radar)' has not signed its report"):
            read_report(forged, signer, ("planner",))


def test_an_outside_participant_needs_no_signature() -> None:
    assert read_report(header(5, "planner:Blocks-0000"), Signer("key"), ("planner",)).node == "planner"


def test_an_outside_participant_may_leave_out_the_scene() -> None:
    for frame_id in ("planner", "planner:"):
        assert read_report(header(5, frame_id), Signer("key"), ("planner",)) == Report("planner", "", 5)


@pytest.mark.parametrize("frame_id", ["", "lidar", "lidar:"])
def test_what_is_no_report_is_refused(frame_id: str) -> None:
    with pytest.raises(ValueError, match="it must be name:scene"):
        read_report(header(5, frame_id), Signer(None), ())
