import json

from simbev_ros.recording.accounting import Accounting, Schedule, Verdict

START_NS, TICK_NS = 3_600_000_000_000, 50_000_000
MANIFEST = {"/every": Schedule(), "/third": Schedule(first_tick=1, period_ticks=3), "/once": Schedule(period_ticks=0)}


def accounting(ticks: int = 6) -> Accounting:
    return Accounting(MANIFEST, start_ns=START_NS, tick_ns=TICK_NS, ticks=ticks)


def awaited_at(account: Accounting, tick: int) -> list[str]:
    """Topics with a message that is due at a tick and has not arrived."""
    return [name for name, topic in account.report().topics.items() if tick in topic.missing_ticks]


def stamp(tick: int) -> int:
    return START_NS + tick * TICK_NS


def test_a_tick_is_finished_when_all_due_messages_have_arrived() -> None:
    account = accounting()
    account.add_message("/every", stamp(0))
    assert account.finished_tick == -1
    assert awaited_at(account, 0) == ["/once"]
    account.add_message("/once", 17)  # a latched topic may have any stamp
    assert account.finished_tick == 0
    account.add_message("/every", stamp(1))
    assert account.finished_tick == 0
    account.add_message("/third", stamp(1))
    assert account.finished_tick == 1


def test_a_later_tick_waits_for_the_earlier_ones() -> None:
    account = accounting()
    account.add_message("/once", 0)
    for tick in (2, 1):
        account.add_message("/every", stamp(tick))
    account.add_message("/third", stamp(1))
    assert account.finished_tick == -1
    account.add_message("/every", stamp(0))
    assert account.finished_tick == 2


def test_a_full_scene_is_complete_with_hand_counted_numbers() -> None:
    account = accounting()
    verdicts = [account.add_message("/every", stamp(tick)) for tick in range(6)]
    verdicts += [account.add_message("/third", stamp(tick)) for tick in (1, 4)]
    verdicts.append(account.add_message("/once", 0))
    report = account.report()
    assert set(verdicts) == {Verdict.EXPECTED}
    assert report.complete and report.problems() == []
    assert account.finished_tick == 5
    assert {topic: entry.expected for topic, entry in report.topics.items()} == {"/every": 6, "/third": 2, "/once": 1}


def test_missing_messages_are_named_with_their_ticks() -> None:
    account = accounting()
    for tick in (0, 3):
        account.add_message("/every", stamp(tick))
    report = account.report()
    assert not report.complete
    assert report.topics["/every"].missing_ticks == (1, 2, 4, 5)
    assert report.problems()[0] == "/every: 2 of 6 messages, missing at ticks 1-2, 4-5"
    assert report.problems()[2] == "/once: 0 of 1 messages, missing at ticks 0"


def test_a_second_message_of_a_tick_is_a_duplicate() -> None:
    account = accounting()
    account.add_message("/every", stamp(0))
    assert account.add_message("/every", stamp(0)) is Verdict.DUPLICATE
    account.add_message("/once", 1)
    assert account.add_message("/once", 2) is Verdict.DUPLICATE
    report = account.report()
    assert (report.topics["/every"].duplicates, report.topics["/every"].is_contested) == (1, True)
    assert not report.topics["/once"].is_contested
    assert report.problems()[0].endswith("1 more came twice from a second sender")


def test_a_bag_that_may_hold_messages_of_a_second_sender_is_not_complete() -> None:
    account = accounting(ticks=1)
    for topic, tick_stamp in (("/once", 0), ("/every", stamp(0)), ("/once", 1)):
        account.add_message(topic, tick_stamp)
    assert account.report().complete
    account.add_message("/every", stamp(0))
    assert not account.report().complete


def test_stamps_that_are_not_due_are_unexpected_and_not_counted() -> None:
    account = accounting(ticks=1)
    account.add_message("/once", 0)
    account.add_message("/every", stamp(0))
    assert account.add_message("/every", stamp(0) + 1) is Verdict.UNEXPECTED
    assert account.add_message("/every", stamp(1)) is Verdict.UNEXPECTED
    assert account.add_message("/third", stamp(0)) is Verdict.UNEXPECTED
    assert account.add_message("/stranger", stamp(0)) is Verdict.UNEXPECTED
    report = account.report()
    assert report.complete
    assert report.problems() == [
        "/every: 1 of 1 messages, 2 more came with a stamp that is not due",
        "/third: 0 of 0 messages, 1 more came with a stamp that is not due",
        "/stranger: 0 of 0 messages, 1 more came with a stamp that is not due",
    ]


def test_warm_up_messages_are_not_counted() -> None:
    account = accounting()
    assert account.add_message("/every", stamp(-1)) is Verdict.WARM_UP
    assert account.report().topics["/every"].unexpected == 0


def test_a_tick_without_due_messages_is_finished_at_once() -> None:
    account = Accounting({"/a": Schedule(period_ticks=2)}, start_ns=0, tick_ns=1, ticks=4)
    account.add_message("/a", 0)
    assert account.finished_tick == 1
    account.add_message("/a", 2)
    assert account.finished_tick == 3


def test_several_messages_per_tick_are_due_at_the_tick_that_follows_them() -> None:
    account = Accounting({"/fast": Schedule(messages_per_tick=7)}, start_ns=START_NS, tick_ns=TICK_NS, ticks=3)
    stamps = [START_NS + TICK_NS * n // 7 for n in range(15)]  # the first tick has only the message at its own stamp
    assert account.add_message("/fast", stamps[0]) is Verdict.EXPECTED
    assert account.finished_tick == 0
    assert {account.add_message("/fast", stamp_ns) for stamp_ns in stamps[1:7]} == {Verdict.EXPECTED}
    assert (account.finished_tick, awaited_at(account, 1)) == (0, ["/fast"])
    assert account.report().topics["/fast"].missing_ticks == (1, 2)
    account.add_message("/fast", stamps[7])
    assert account.finished_tick == 1
    assert account.add_message("/fast", stamps[7]) is Verdict.DUPLICATE
    assert account.add_message("/fast", stamps[8] + 1) is Verdict.UNEXPECTED
    assert account.add_message("/fast", START_NS - TICK_NS // 7) is Verdict.WARM_UP
    assert account.report().topics["/fast"].expected == 15
    account.end_at(2)
    assert account.is_finished and account.report().topics["/fast"].expected == 8
    assert account.add_message("/fast", stamps[8]) is Verdict.UNEXPECTED


def test_the_report_becomes_custom_data_of_the_bag() -> None:
    account = accounting()
    account.add_message("/every", stamp(0))
    data = account.report().custom_data("Town01-0007")
    assert (data["scene"], data["complete"], data["ticks"]) == ("Town01-0007", "false", "6")
    assert json.loads(data["expected"]) == {"/every": 6, "/third": 2, "/once": 1}
    assert json.loads(data["recorded"]) == {"/every": 1, "/third": 0, "/once": 0}


def test_a_scene_that_ends_early_is_complete_up_to_its_end() -> None:
    account = accounting()
    account.add_message("/once", 0)
    for tick in (0, 1):
        account.add_message("/every", stamp(tick))
    account.add_message("/third", stamp(1))
    assert not account.report().complete
    account.end_at(3)
    assert account.report().topics["/every"].missing_ticks == (2,)
    account.add_message("/every", stamp(2))
    report = account.report()
    assert report.complete and account.finished_tick == 2
    assert {topic: entry.expected for topic, entry in report.topics.items()} == {"/every": 3, "/third": 1, "/once": 1}
    assert report.custom_data("a")["ticks"] == "3"
    assert account.add_message("/every", stamp(3)) is Verdict.UNEXPECTED


def test_sporadic_messages_are_neither_missing_nor_unexpected() -> None:
    account = Accounting({"/events": Schedule(sporadic=True)}, start_ns=START_NS, tick_ns=TICK_NS, ticks=6)
    assert account.finished_tick == 5
    verdicts = [account.add_message("/events", stamp(tick)) for tick in (3, 3, 5, -1, 6)]
    assert verdicts == [*[Verdict.EXPECTED] * 3, Verdict.WARM_UP, Verdict.UNEXPECTED]
    accounting = account.report().topics["/events"]
    assert (accounting.expected, accounting.recorded, accounting.unexpected) == (3, 3, 1)
    assert account.report().complete


def test_a_scene_is_finished_when_the_announced_events_have_arrived() -> None:
    account = Accounting(
        {"/a": Schedule(), "/events": Schedule(sporadic=True)}, start_ns=START_NS, tick_ns=TICK_NS, ticks=6
    )
    account.add_message("/a", stamp(0))
    account.add_message("/events", stamp(0))
    account.end_at(1, {"/events": 2})
    assert not account.is_finished and not account.report().complete
    assert account.report().problems() == ["/events: 1 of 2 messages"]
    account.add_message("/events", stamp(0))
    assert account.is_finished and account.report().complete


def test_events_that_are_announced_after_the_end_are_awaited_by_topic() -> None:
    schedules = {"/a": Schedule(), "/events": Schedule(sporadic=True), "/drive": Schedule(sporadic=True)}
    account = Accounting(schedules, start_ns=START_NS, tick_ns=TICK_NS, ticks=6)
    account.add_message("/a", stamp(0))
    account.end_at(1)
    account.announce("/events", 2)
    account.announce("/drive", 0)
    account.announce("/a", 3)
    assert not account.is_finished
    account.add_message("/events", stamp(0))
    account.add_message("/events", stamp(0))
    assert account.is_finished and account.report().complete
