"""Decides by what a driver reports its ticks: by its stamped commands, or by messages on /sync/ready. Pure."""

from simbev_ros.ros.nodes.reports import Report
from simbev_ros.schema.scene.spec import scene_number_of


class DriverReports:
    """Reports of drivers. One on /sync/ready may arrive before its command, so the command counts instead.

    A command without the stamp of an input counts for no tick; the world would wait forever. Then the reports count.
    """

    def __init__(self) -> None:
        self._played, self._unstamped = set[int](), set[str]()
        self._held: dict[str, Report] = {}

    def start_scene(self, number: int) -> None:
        """Expect commands with stamps of this scene, by its number; late ones may be of scenes before it."""
        self._played.add(number)
        self._held.clear()

    def counts(self, report: Report) -> bool:
        """Whether a driver's report on /sync/ready counts."""
        if report.node not in self._unstamped:
            self._held[report.node] = report
        return report.node in self._unstamped

    def check_stamp(self, driver: str, stamp_ns: int) -> None:
        """Note the stamp of a driver's command.

        Raises:
            ValueError: It is of no scene that has been played.
        """
        if scene_number_of(stamp_ns) in self._played:
            self._unstamped.discard(driver)
        else:
            self._unstamped.add(driver)
            raise ValueError("header.stamp must be that of the input; a command with another stamp has no effect")

    def take_held(self, driver: str) -> Report | None:
        """Return the last report of a driver that did not count when it arrived, if it counts now."""
        return self._held.pop(driver, None) if driver in self._unstamped else None
