"""The number of the format in which files and bags are written, and the rules by which other versions read them.

A reader ignores fields that it does not know, at every level. A field that comes later has a default, which stands for
what earlier versions did. A format that is newer than the reader's is refused. What is read gets the reader's format.
"""

from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, BaseModel, Field
from pydantic_core import PydanticCustomError

from simbev_ros.config.base import Model

FORMAT = 1
"""The format that this version writes. The number grows when an earlier reader would misunderstand what is written."""

M = TypeVar("M", bound=BaseModel)


def require_known_format(number: int) -> int:
    """This version's format number, given that of something stored.

    Raises:
        PydanticCustomError: The number is that of a newer version. It is a ValueError.
    """
    if number > FORMAT:
        raise PydanticCustomError("newer_format", f"a newer simbev_ros wrote it; allowed: 1 to {FORMAT}")
    return FORMAT


class Stored(Model):
    """Base of a stored model. ``Model`` refuses unknown fields, as in a configuration; ``from_json`` ignores them."""

    format: Annotated[int, Field(ge=1), AfterValidator(require_known_format)] = FORMAT

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Read what any version wrote.

        Raises:
            ValidationError: The text does not fit the model, or has a newer format.
        """
        return cls.model_validate_json(text, extra="ignore")


def read_stored(model: type[M], data: Any) -> M:
    """Read a part of something stored, which has no format number of its own.

    Raises:
        ValidationError: The data do not fit the model.
    """
    return model.model_validate(data, extra="ignore")
