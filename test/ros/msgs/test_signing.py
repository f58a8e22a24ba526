"""Signatures reveal messages that others have made, copied or changed."""

import hashlib
import hmac
import json

import pytest

from simbev_ros.ros.msgs.signing import KEY_VARIABLE, Signer, content_of, make_key, signed_json
from simbev_ros.scene.ending import SceneEnd

END = SceneEnd(scene="Blocks-0000", tick=19, reason="duration", events=3)


def test_a_signature_is_an_hmac_of_128_bits() -> None:
    expected = hmac.new(b"key", b"text", hashlib.sha256).hexdigest()[:32]
    assert Signer("key").sign("text") == expected
    assert Signer("key").is_valid(expected, "text")
    assert not Signer("key").is_valid(expected, "text ")
    assert not Signer("other").is_valid(expected, "text")
    assert not Signer("key").is_valid("§", "text")


def test_signed_content_comes_back_and_changed_content_does_not() -> None:
    signer = Signer(make_key())
    text = signed_json(END, signer)
    assert content_of(SceneEnd, text, signer) == END
    fields = json.loads(text)
    assert fields.pop("signature") and fields == END.model_dump()
    for forged in (
        json.dumps({**json.loads(text), "tick": 3}),
        json.dumps(fields),
        json.dumps({**fields, "signature": 5}),
        signed_json(END, Signer(make_key())),
    ):
        with pytest.raises(ValueError, match="is not signed by this graph"):
            content_of(SceneEnd, forged, signer)


@pytest.mark.parametrize("text", ["", "nonsense", "[]", "null", "{}", '{"scene": 1}', '{"tick": -1}', "[" * 3000])
def test_malformed_content_is_an_error_that_nodes_expect(text: str) -> None:
    with pytest.raises((ValueError, RecursionError)):
        content_of(SceneEnd, text, Signer("key"))


def test_without_a_key_everything_is_believed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(KEY_VARIABLE, raising=False)
    signer = Signer.from_environment()
    assert not signer.checks
    assert content_of(SceneEnd, END.model_dump_json(), signer) == END
    monkeypatch.setenv(KEY_VARIABLE, "key")
    assert Signer.from_environment().sign("text") == Signer("key").sign("text")
