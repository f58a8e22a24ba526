"""A pytest plugin that runs a failed test once more, and lists those that passed then as flaky; for ``--retry-failed``.

Before the second run all fixtures are torn down, also those of the module and of the session: what made the test fail
may be a recorded scene that many tests share.
"""

from collections.abc import Iterator

import pytest
from _pytest.runner import call_and_report

_FLAKY: list[tuple[str, str]] = []
"""Names of the tests that passed the second time only, and how they failed before."""


def pytest_runtest_protocol(item: pytest.Item, nextitem: pytest.Item | None) -> bool:
    """Run a test, and a second time if it fails."""
    hook = item.ihook
    hook.pytest_runtest_logstart(nodeid=item.nodeid, location=item.location)
    reports = list(_run(item, nextitem))
    failures = [report for report in reports if report.failed]
    if failures:
        reports = list(_run(item, nextitem))
        if not any(report.failed for report in reports):
            _FLAKY.append((item.nodeid, "\n".join(report.longreprtext for report in failures)))
    for report in reports:
        hook.pytest_runtest_logreport(report=report)
    hook.pytest_runtest_logfinish(nodeid=item.nodeid, location=item.location)
    return True


def _run(item: pytest.Item, nextitem: pytest.Item | None) -> Iterator[pytest.TestReport]:
    """Set up, call and tear down; a failed test tears down everything."""
    item._initrequest()  # type: ignore[attr-defined]
    has_failed = False
    for when in ("setup", "call"):
        if not has_failed:
            yield (report := call_and_report(item, when, log=False))  # type: ignore[arg-type]
            has_failed = has_failed or not report.passed
    is_broken = has_failed and report.failed
    yield call_and_report(item, "teardown", log=False, nextitem=None if is_broken else nextitem)
    item._request, item.funcargs = False, None  # type: ignore[attr-defined]


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """List the flaky tests."""
    if _FLAKY:
        terminalreporter.section("flaky tests: failed once, passed when they ran once more")
        for name, failure in _FLAKY:
            terminalreporter.write_line(f"FLAKY {name}", yellow=True, bold=True)
            terminalreporter.write_line(failure)
        terminalreporter.write_line(f"{len(_FLAKY)} flaky: {', '.join(name for name, _ in _FLAKY)}", yellow=True)
