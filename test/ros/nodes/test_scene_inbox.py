"""Scenes are delivered when they are both announced and requested, in any order."""

import pytest

from simbev_ros.ros.nodes.scene_inbox import SceneInbox


@pytest.fixture
def delivered() -> list[tuple[str, bytes]]:
    return []


@pytest.fixture
def inbox(delivered: list[tuple[str, bytes]]) -> SceneInbox[bytes]:
    return SceneInbox(lambda specification, message: delivered.append((specification, message)))


def test_announcement_and_request_may_come_in_any_order(
    inbox: SceneInbox[bytes], delivered: list[tuple[str, bytes]]
) -> None:
    inbox.announce("a", b"1")
    assert delivered == []
    inbox.request("a")
    inbox.request("b")
    inbox.announce("b", b"2")
    inbox.announce("b", b"3")  # a live scene starts again
    assert delivered == [("a", b"1"), ("b", b"2"), ("b", b"3")]


def test_scenes_of_others_are_not_delivered_and_do_not_displace_the_requested_one(
    inbox: SceneInbox[bytes], delivered: list[tuple[str, bytes]]
) -> None:
    inbox.announce("own", b"1")
    for number in range(7):
        inbox.announce(f"forged {number}", b"0")
    inbox.request("own")
    inbox.announce("forged", b"0")
    assert delivered == [("own", b"1")]


def test_what_waits_is_bounded(inbox: SceneInbox[bytes]) -> None:
    for number in range(1000):
        inbox.announce(f"forged {number}", b"0")
    assert len(inbox._waiting) <= 8
