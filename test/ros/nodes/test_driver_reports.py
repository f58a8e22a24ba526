"""Commands count as reports of their driver; without stamps of inputs they cannot, and its reports do."""

import pytest

from simbev_ros.ros.nodes.driver_reports import DriverReports
from simbev_ros.ros.nodes.reports import Report

HOUR_NS = 3600 * 10**9
SCENE_4_NS, SCENE_5_NS = 5 * HOUR_NS + 1, 6 * HOUR_NS + 1
REPORT = Report("ego_driver", "Blocks-0005", SCENE_5_NS)


@pytest.fixture
def reports() -> DriverReports:
    made = DriverReports()
    made.start_scene(4)
    made.start_scene(5)
    return made


def test_reports_do_not_count_beside_stamped_commands(reports: DriverReports) -> None:
    reports.check_stamp("ego_driver", SCENE_5_NS)
    assert not reports.counts(REPORT)
    assert reports.take_held("ego_driver") is None


@pytest.mark.parametrize("stamp_ns", [0, HOUR_NS // 2, 99 * HOUR_NS, 1_796_000_000 * 10**9])
def test_reports_count_beside_commands_without_stamps_of_inputs(reports: DriverReports, stamp_ns: int) -> None:
    assert not reports.counts(REPORT)
    with pytest.raises(ValueError, match=r"header.stamp must be that of the input"):
        reports.check_stamp("ego_driver", stamp_ns)
    assert reports.take_held("ego_driver") == REPORT
    assert reports.take_held("ego_driver") is None
    assert reports.counts(REPORT)


def test_a_late_command_of_the_scene_before_changes_nothing(reports: DriverReports) -> None:
    reports.check_stamp("ego_driver", SCENE_4_NS)
    assert not reports.counts(REPORT)


def test_a_driver_that_learns_to_stamp_its_commands_is_waited_for_by_them_again(reports: DriverReports) -> None:
    with pytest.raises(ValueError, match=r"header.stamp"):
        reports.check_stamp("ego_driver", 0)
    reports.check_stamp("ego_driver", SCENE_5_NS)
    assert not reports.counts(REPORT)
