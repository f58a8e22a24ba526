"""Mutations of valid files and messages: damage by a disk, mistakes of other software, and the work of an attacker.

Bytes are changed anywhere; of formats with a structure, also single values and parts, so that mutations get past the
first check of a reader. Randomness comes from the caller: from hypothesis, which then can shrink a mutation, or from a
seed of the coverage-guided fuzzer.
"""

import io
import json
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from random import Random
from typing import Any
from xml.etree import ElementTree

import yaml

Mutator = Callable[[bytes, Random], bytes]
"""Returns a mutated copy of a sample; it must accept any bytes, as samples may be mutations themselves."""

_MAX_STEPS = 4
_MAX_PART_BYTES = 64
_MAX_COPY_BYTES = 1000
_INTEGERS = (0, 1, -1, 2, 7, 255, 256, 65_535, 2**31 - 1, -(2**31), 2**32 - 1, 2**53 + 1, 2**63 - 1, -(2**63), 2**64)
_TEXTS = (
    "",
    "nan",
    "inf",
    "-inf",
    "1e308",
    "-1e-320",
    "1e999",
    "0x10",
    "../../x",
    "/",
    "a:b:c",
    "\0",
    "\u20ac",
    "a" * 300,
)
_VALUES: tuple[Any, ...] = (None, True, False, 0.5, 1e308, float("nan"), float("inf"), [], {}, *_INTEGERS, *_TEXTS)
_NUMBER = re.compile(rb"\d+(?:\.\d+)?")
_PNG_MAGIC_BYTES = 8


def mutate_bytes(sample: bytes, rng: Random) -> bytes:
    """Mutate bytes anywhere, in one or a few steps."""
    data = bytearray(sample)
    for _ in range(rng.randint(1, _MAX_STEPS)):
        _STEPS[rng.randrange(len(_STEPS))](data, rng)
    return bytes(data)


def _flip_bit(data: bytearray, rng: Random) -> None:
    if data:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)


def _overwrite_integer(data: bytearray, rng: Random) -> None:
    size = 1 << rng.randrange(4)
    start = rng.randint(0, len(data))
    value = _INTEGERS[rng.randrange(len(_INTEGERS))] % (1 << 8 * size)
    data[start : start + size] = value.to_bytes(size, "little")


def _change_number(data: bytearray, rng: Random) -> None:
    """Replace a number that is written in digits."""
    found = list(_NUMBER.finditer(data))
    if found:
        match = found[rng.randrange(len(found))]
        texts = (*map(str, _INTEGERS), *_TEXTS)
        data[match.start() : match.end()] = texts[rng.randrange(len(texts))].encode()


def _truncate(data: bytearray, rng: Random) -> None:
    del data[rng.randint(0, len(data)) :]


def _delete_part(data: bytearray, rng: Random) -> None:
    start, stop = _part(data, rng)
    del data[start:stop]


def _repeat_part(data: bytearray, rng: Random) -> None:
    start, stop = _part(data, rng)
    data[stop:stop] = data[start:stop] * rng.choice([1, 2, 50])


def _move_part(data: bytearray, rng: Random) -> None:
    start, stop = _part(data, rng)
    part = data[start:stop]
    del data[start:stop]
    target = rng.randint(0, len(data))
    data[target:target] = part


def _overwrite_part(data: bytearray, rng: Random) -> None:
    """Copy a part over another one."""
    start, stop = _part(data, rng)
    target = rng.randint(0, len(data))
    data[target : target + stop - start] = data[start:stop]


def _part(data: bytearray, rng: Random) -> tuple[int, int]:
    start = rng.randint(0, len(data))
    return start, min(len(data), start + rng.randint(1, _MAX_PART_BYTES))


_STEPS: tuple[Callable[[bytearray, Random], None], ...] = (
    _flip_bit,
    _overwrite_integer,
    _change_number,
    _truncate,
    _delete_part,
    _repeat_part,
    _move_part,
    _overwrite_part,
)


def _structured(mutate: Mutator) -> Mutator:
    """A mutator of a format's structure that sometimes mutates bytes instead, and always bytes of another format."""

    def mutate_structure_or_bytes(sample: bytes, rng: Random) -> bytes:
        if rng.randrange(4) == 0:
            return mutate_bytes(sample, rng)
        try:
            return mutate(sample, rng)
        except Exception:  # whatever the format's parser raises
            return mutate_bytes(sample, rng)

    return mutate_structure_or_bytes


@_structured
def mutate_json(sample: bytes, rng: Random) -> bytes:
    """Mutate values of JSON."""
    return json.dumps(_mutated_tree(json.loads(sample), rng)).encode()


@_structured
def mutate_yaml(sample: bytes, rng: Random) -> bytes:
    """Mutate values of YAML."""
    return yaml.safe_dump(_mutated_tree(yaml.safe_load(sample), rng), sort_keys=False).encode()


def _mutated_tree(tree: Any, rng: Random) -> Any:
    root = [tree]
    for _ in range(rng.randint(1, _MAX_STEPS)):
        places = list(_places(root))
        holder, key = places[rng.randrange(len(places))]
        match rng.randrange(6):
            case 0 if len(places) > 1:  # remove it
                if holder is not root:
                    del holder[key]
            case 1:  # put another value of the tree there
                other, other_key = places[rng.randrange(len(places))]
                copy = json.dumps(other[other_key], default=str)
                if len(copy) < _MAX_COPY_BYTES:
                    holder[key] = json.loads(copy)
            case 2:  # rename its key, or repeat it
                value = holder[key]
                if isinstance(holder, dict):
                    holder[_TEXTS[rng.randrange(len(_TEXTS))]] = value
                elif holder is not root:
                    holder.insert(key, value)
            case 3:  # nest it
                for _ in range(rng.choice([1, 5, 100])):
                    holder[key] = [holder[key]]
            case _:
                holder[key] = _VALUES[rng.randrange(len(_VALUES))]
    return root[0]


def _places(tree: Any) -> Any:
    """Yield each list or mapping with each of its keys, depth first."""
    keys = tree if isinstance(tree, dict) else range(len(tree))
    for key in list(keys):
        yield tree, key
        if isinstance(tree[key], (dict, list)):
            yield from _places(tree[key])


@_structured
def mutate_xml(sample: bytes, rng: Random) -> bytes:
    """Mutate attributes and elements of XML."""
    root = ElementTree.fromstring(sample)
    for _ in range(rng.randint(1, _MAX_STEPS)):
        elements = list(root.iter())
        element = elements[rng.randrange(len(elements))]
        children, names = list(element), sorted(element.keys())
        match rng.randrange(7):
            case 0 if children:
                element.remove(children[rng.randrange(len(children))])
            case 1 if children:  # repeat a child, elsewhere
                index = rng.randrange(len(children))
                element.insert(rng.randint(0, len(children)), children[index])
            case 2:  # put a copy of another element into it
                copy = ElementTree.tostring(elements[rng.randrange(len(elements))])
                if len(copy) < _MAX_COPY_BYTES:
                    element.append(ElementTree.fromstring(copy))
            case 3 if names:
                del element.attrib[names[rng.randrange(len(names))]]
            case 4 if names:  # take an attribute's value from another element
                name = names[rng.randrange(len(names))]
                values = [other.get(name, "") for other in elements if name in other.keys()]  # noqa: SIM118
                element.set(name, values[rng.randrange(len(values))])
            case _ if names:
                name = names[rng.randrange(len(names))]
                element.set(name, _xml_text(element.get(name, ""), rng))
            case _:
                element.text = _xml_text(element.text or "", rng)
    return ElementTree.tostring(root)


def _xml_text(text: str, rng: Random) -> str:
    """Another text; of several numbers, only one is changed."""
    texts = (*map(str, _INTEGERS), *_TEXTS)
    new = texts[rng.randrange(len(texts))].replace("\0", "")
    words = re.split(r"([ ,])", text)
    words[2 * rng.randrange((len(words) + 1) // 2)] = new
    return "".join(words)


@_structured
def mutate_npz(sample: bytes, rng: Random) -> bytes:
    """Mutate the arrays in an NPZ file; the checksums stay right."""
    with zipfile.ZipFile(io.BytesIO(sample)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    names = list(members)
    name, other = names[rng.randrange(len(names))], names[rng.randrange(len(names))]
    match rng.randrange(4):
        case 0:
            del members[name]
        case 1:
            members[name] = members[other]
        case _:
            members[name] = mutate_bytes(members[name], rng)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for each, data in members.items():
            archive.writestr(each, data)
    return stream.getvalue()


@_structured
def mutate_png(sample: bytes, rng: Random) -> bytes:
    """Mutate chunks of a PNG, which may begin after a header; the checksums stay right."""
    start = sample.index(b"\x89PNG") + _PNG_MAGIC_BYTES
    position, chunks = start, list[tuple[bytes, bytes]]()
    while position < len(sample):
        (length,) = struct.unpack_from(">I", sample, position)
        chunks.append((sample[position + 4 : position + 8], sample[position + 8 : position + 8 + length]))
        position += 12 + length
    index = rng.randrange(len(chunks))
    kind, content = chunks[index]
    match rng.randrange(3):
        case 0 if kind == b"IDAT":
            chunks[index] = kind, zlib.compress(mutate_bytes(zlib.decompress(content), rng))
        case 1:
            chunks.insert(rng.randint(0, len(chunks)), chunks[index])
        case _:
            chunks[index] = kind, mutate_bytes(content, rng)
    written = [struct.pack(">I", len(c)) + k + c + struct.pack(">I", zlib.crc32(k + c)) for k, c in chunks]
    return sample[:start] + b"".join(written)


_RAW, _ZLIB_DATA, _DATASIZE = 1 << 3 | 2, 3 << 3 | 2, 3 << 3
"""Tags of fields in PBF: their numbers in the format's description, and how they are encoded."""


@_structured
def mutate_pbf(sample: bytes, rng: Random) -> bytes:
    """Mutate fields at any depth of a block of OpenStreetMap PBF, and unpack the block; its size stays right."""
    blocks, position = list[tuple[bytes, bytes]](), 0
    while position < len(sample):
        start = position + 4 + int.from_bytes(sample[position : position + 4], "big")
        header = sample[position + 4 : start]
        position = start + dict(_fields(header))[_DATASIZE]
        blocks.append((header, sample[start:position]))
    index = rng.randrange(len(blocks))
    header, blob = blocks[index]
    fields = dict(_fields(blob))
    content = fields[_RAW] if _RAW in fields else zlib.decompress(fields[_ZLIB_DATA])
    for _ in range(rng.randint(1, _MAX_STEPS)):
        content = _mutate_message(content, rng)
    blob = _message([(_RAW, content)])
    blocks[index] = _message([(tag, len(blob) if tag == _DATASIZE else each) for tag, each in _fields(header)]), blob
    return b"".join(len(header).to_bytes(4, "big") + header + blob for header, blob in blocks)


def _mutate_message(message: bytes, rng: Random) -> bytes:
    """Mutate a field of a protobuf message or of one inside it, or what the bytes may be instead: integers or text."""
    try:
        fields = _fields(message)
    except (ValueError, IndexError):
        fields = []
    if not fields or rng.randrange(4) == 0:
        return mutate_bytes(message, rng) if rng.randrange(2) else _mutate_packed(message, rng)
    index = rng.randrange(len(fields))
    tag, value = fields[index]
    match rng.randrange(10):
        case 0:
            del fields[index]
        case 1:
            fields.insert(rng.randint(0, len(fields)), fields[index])
        case _:
            fields[index] = tag, _mutate_message(value, rng) if isinstance(value, bytes) else _integer(rng)
    return _message(fields)


def _mutate_packed(packed: bytes, rng: Random) -> bytes:
    """Replace one of the integers that are one after the other."""
    starts = [0, *(index + 1 for index, byte in enumerate(packed) if byte < 0x80)]
    index = rng.randrange(len(starts))
    return packed[: starts[index]] + _varint(_integer(rng)) + packed[(*starts, len(packed))[index + 1] :]


def _integer(rng: Random) -> int:
    """An integer as an unsigned one of 64 bits, or as protobuf stores signed ones."""
    value = _INTEGERS[rng.randrange(len(_INTEGERS))]
    return (value if rng.randrange(2) else 2 * value if value >= 0 else -2 * value - 1) % 2**64


def _fields(message: bytes) -> list[tuple[int, Any]]:
    """Tags and values, integers or bytes, of a protobuf message; other kinds of values do not occur in PBF."""
    fields, position = list[tuple[int, Any]](), 0
    while position < len(message):
        tag, position = _read_varint(message, position)
        value, position = _read_varint(message, position)
        if tag & 7 == 2 and position + value <= len(message):
            fields.append((tag, message[position : position + value]))
            position += value
        elif tag & 7 == 0:
            fields.append((tag, value))
        else:
            raise ValueError("no such message")
    return fields


def _message(fields: list[tuple[int, Any]]) -> bytes:
    texts = ((_varint(len(each)) + each if isinstance(each, bytes) else _varint(each)) for _, each in fields)
    return b"".join(_varint(tag) + text for (tag, _), text in zip(fields, texts, strict=True))


def _read_varint(message: bytes, position: int) -> tuple[int, int]:
    """An integer, seven bits a byte, and the position after it."""
    value = shift = 0
    while message[position] >= 0x80:
        value, shift, position = value | (message[position] & 0x7F) << shift, shift + 7, position + 1
    return value | message[position] << shift, position + 1


def _varint(value: int) -> bytes:
    size = max(1, -(-value.bit_length() // 7))
    return bytes(value >> 7 * index & 0x7F | (index < size - 1) << 7 for index in range(size))
