"""Signs the messages that steer a graph, so that its nodes follow only each other.

A ROS domain has neighbors: other graphs, replayed bags, nodes under development. Whatever they publish on
/world/request, /world/end, or on /sync/ready in the name of one of the graph's nodes, is recognized by its signature.
The key is made for each graph and passed on in the environment of its processes, which only their user can read.
Signatures do not hide anything; encryption and access control are SROS 2's.
"""

import hmac
import json
import os
import secrets
from typing import Self, TypeVar

from simbev_ros.config.base import Model
from simbev_ros.foundation.files.structured_text import parse_json

KEY_VARIABLE = "SIMBEV_GRAPH_KEY"
"""Environment variable with the key, for the processes of a graph; without it, as for nodes started by hand, all
messages are believed."""

_SIGNATURE_CHARACTERS = 32
_SIGNATURE = "signature"

_Content = TypeVar("_Content", bound=Model)


class Signer:
    """Signs and checks texts.

    Args:
        key: The graph's key; None: nothing is signed and every signature is valid.
    """

    def __init__(self, key: str | None) -> None:
        self._key = None if key is None else key.encode()

    @classmethod
    def from_environment(cls) -> Self:
        """The signer of the graph that this process belongs to."""
        return cls(os.environ.get(KEY_VARIABLE))

    @property
    def checks(self) -> bool:
        """Whether it has a key."""
        return self._key is not None

    def sign(self, text: str) -> str:
        """The signature of a text, empty without a key (HMAC-SHA256 as in RFC 2104, cut to 128 bits)."""
        if self._key is None:
            return ""
        return hmac.new(self._key, text.encode(), "sha256").hexdigest()[:_SIGNATURE_CHARACTERS]

    def is_valid(self, signature: str, text: str) -> bool:
        """Whether the signature is that of the text."""
        return hmac.compare_digest(signature.encode(), self.sign(text).encode()) or not self.checks


def make_key() -> str:
    """A key for a new graph."""
    return secrets.token_hex(16)


def signed_json(content: Model, signer: Signer) -> str:
    """JSON of a model, with its signature as one more field."""
    signature = signer.sign(content.model_dump_json())
    return json.dumps({**content.model_dump(mode="json"), _SIGNATURE: signature})


def content_of(kind: type[_Content], text: str, signer: Signer) -> _Content:
    """The model in a ``signed_json``.

    Raises:
        ValueError: The text is not such a model, or has another signer.
    """
    fields = parse_json(text)
    if not isinstance(fields, dict):
        raise ValueError("is not a JSON object")
    signature = fields.pop(_SIGNATURE, "")
    content = kind.model_validate_json(json.dumps(fields))
    if not isinstance(signature, str) or not signer.is_valid(signature, content.model_dump_json()):
        raise ValueError("is not signed by this graph")
    return content
