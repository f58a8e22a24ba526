"""A node's load: ticks, time per tick, and the time of parts of the work, also of threads."""

import time

import pytest

from simbev_ros.ros.nodes.load_meter import BUSY, LoadMeter, part_keys


def spend(cpu_s: float) -> None:
    end_s = time.thread_time() + cpu_s
    while time.thread_time() < end_s:
        pass


def test_a_part_within_another_one_counts_once() -> None:
    meter = LoadMeter()
    for _ in range(2):
        with meter.busy(), meter.part("message"):
            spend(0.01)
            for _ in range(2):
                with meter.part("send"):
                    spend(0.02)
    load = meter.read()
    (_, message_ms), (_, send_ms) = (tuple(load[key] for key in part_keys(part)) for part in ("message", "send"))
    assert load["ticks"] == 2
    assert message_ms == pytest.approx(10, abs=2)
    assert send_ms == pytest.approx(40, abs=2)
    assert load[BUSY] >= message_ms + send_ms


def test_work_of_threads_is_timed_and_counts_for_the_next_reading_with_ticks() -> None:
    meter = LoadMeter()
    with meter.pool("encode") as threads:
        for future in [threads.submit(spend, 0.02) for _ in range(2)]:
            future.result()
    wall, cpu = part_keys("encode")
    assert cpu not in meter.read(), "no tick is finished"
    with meter.busy():
        pass
    load = meter.read()
    assert load[cpu] == pytest.approx(40, abs=4)
    assert load[wall] >= load[cpu] - 1
    with meter.busy():
        pass
    assert cpu not in meter.read()


def test_a_part_that_fails_is_timed_and_parts_can_be_discarded() -> None:
    meter = LoadMeter()
    with pytest.raises(ValueError, match="made up"), meter.part("label"):
        raise ValueError("made up")
    with meter.busy():
        pass
    assert part_keys("label")[0] in meter.read()
    with meter.part("label"):
        pass
    meter.discard_parts()
    with meter.busy():
        pass
    assert part_keys("label")[0] not in meter.read()
