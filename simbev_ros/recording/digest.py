"""One hash per topic: equal exactly when the topics hold the same messages with the same stamps in the same order."""

import hashlib
import struct
from collections.abc import Callable, Mapping

from simbev_ros.recording.reader import SceneBag

_PREFIX = struct.Struct("<qQ")


def topic_digests(bag: SceneBag, progress: Callable[[int], None] = lambda _: None) -> dict[str, str]:
    """SHA-256, in hexadecimal, of each topic: per message its stamp in ns, its length, its payload.

    Args:
        bag: The bag to read, as a whole.
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
    """One SHA-256 over the digests of all topics, whatever their order."""
    lines = "".join(f"{topic} {digest}\n" for topic, digest in sorted(digests.items()))
    return hashlib.sha256(lines.encode()).hexdigest()
