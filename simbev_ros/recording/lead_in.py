"""The world just before tick 0: kept in a bag as an attachment, so that a replay begins with what sensors saw before.

It is JSON, a list of ``{"topic": …, "stamp_ns": …, "type": …, "cdr": base64 of the serialised message}``.
"""

import base64
import json
from collections.abc import Iterable

from simbev_ros.errors import BagError
from simbev_ros.recording.reader import RawMessage


def lead_in_attachment(messages: Iterable[RawMessage]) -> bytes:
    """The attachment of some messages, in the order of their stamps and topics."""
    entries = [
        {
            "topic": message.topic,
            "stamp_ns": message.stamp_ns,
            "type": message.type_name,
            "cdr": base64.b64encode(message.data).decode(),
        }
        for message in sorted(messages, key=lambda message: (message.stamp_ns, message.topic))
    ]
    return json.dumps(entries).encode()


def lead_in_messages(attachment: bytes) -> list[RawMessage]:
    """The messages of an attachment.

    Raises:
        BagError: it is not what ``lead_in_attachment`` makes.
    """
    try:
        return [
            RawMessage(entry["topic"], int(entry["stamp_ns"]), entry["type"], base64.b64decode(entry["cdr"]))
            for entry in json.loads(attachment)
        ]
    except (ValueError, KeyError, TypeError) as error:
        raise BagError(f"the lead-in is damaged: {error}") from None
