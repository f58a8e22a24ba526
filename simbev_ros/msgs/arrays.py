"""Puts large data into messages with a single copy."""

from array import array

from simbev_ros.types import AnyArray


def bytes_field(data: AnyArray | bytes) -> "array[int]":
    """Value of a message's field ``uint8[]`` with the bytes of a C-contiguous array, or of another object."""
    field = array("B")
    field.frombytes(data if isinstance(data, bytes) else data.reshape(-1).view("u1").data)
    return field
