"""Puts large data into messages with a single copy."""

from array import array

from simbev_ros.foundation.types import AnyArray


def bytes_field(data: AnyArray | bytes) -> "array[int]":
    """Value of a message's field ``uint8[]`` with the bytes of a C-contiguous array, or of another object.

    Assign it to the field of a message that was made with ``check_fields=True``, which keeps the array as it is. The
    constructor and the fields of other messages copy it.
    """
    field = array("B")
    field.frombytes(data if isinstance(data, bytes) else data.reshape(-1).view("u1").data)
    return field
