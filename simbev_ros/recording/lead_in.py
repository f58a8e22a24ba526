"""Lead-in of a scene: messages from just before tick 0, attached so that a replay starts with the same sensor history.

The attachment is JSON, a list of ``{"topic": …, "stamp_ns": …, "type": …, "cdr": base64 of the serialized message}``.
"""

import base64
import json
from collections.abc import Iterable
from typing import Any

from simbev_ros.foundation.errors import FOREIGN_ERRORS, BagError
from simbev_ros.foundation.files.structured_text import parse_json
from simbev_ros.recording.reader import RawMessage


def lead_in_attachment(messages: Iterable[RawMessage]) -> bytes:
    """Encode messages as an attachment, ordered by stamp and topic."""
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
    """Decode the messages of an attachment.

    Raises:
        BagError: The attachment is damaged.
    """
    try:
        return [_message(**entry) for entry in parse_json(attachment)]
    except FOREIGN_ERRORS as error:
        raise BagError(f"the lead-in is damaged: {error}") from None


def _message(topic: Any, stamp_ns: Any, type: Any, cdr: Any, **_: Any) -> RawMessage:
    """The message of an entry; other fields are ignored. Raises ValueError or TypeError if the entry is damaged."""
    if not (isinstance(topic, str) and isinstance(stamp_ns, int) and isinstance(type, str)):
        raise ValueError("a topic, stamp or type is missing")
    return RawMessage(topic, stamp_ns, type, base64.b64decode(cdr))
