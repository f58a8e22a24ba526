"""Digests of bags: a topic's digest is equal exactly if it has the same messages and stamps in the same order."""

import hashlib
import struct
from collections.abc import Callable, Mapping

from simbev_ros.recording.reader import SceneBag

_PREFIX = struct.Struct("<QQ")


def topic_digests(bag: SceneBag, progress: Callable[[int], None] = lambda _: None) -> dict[str, str]:
    """Hexadecimal SHA-256 of each topic, over stamp in ns, length and payload of its messages, by topic name.

    Args:
        bag: The bag, all of which is read.
        progress: Called with 1 after each message.
    """
    hashes = {name: hashlib.sha256() for name in bag.topics}
    for message in bag.messages():
        running = hashes[message.topic]
        running.update(_PREFIX.pack(message.stamp_ns, len(message.data)))
        running.update(message.data)
        progress(1)
    return {name: running.hexdigest() for name, running in hashes.items()}


def scene_digest(digests: Mapping[str, str]) -> str:
    """Hexadecimal SHA-256 over the digests of all topics, independent of their order."""
    lines = "".join(f"{topic} {digest}\n" for topic, digest in sorted(digests.items()))
    return hashlib.sha256(lines.encode()).hexdigest()
