"""Names that data may contain: of maps, scenes, splits, agents and sensors.

Configurations, bags and datasets are passed around, and paths, topics and pages are made from the names in them. Every
model that reads a name declares it as one of these types, so that a name is never ``../../x``.
"""

from typing import Annotated, Final

from pydantic import Field

NAME_PATTERN: Final = "[A-Za-z0-9][A-Za-z0-9_-]*"
"""Regular expression of a ``Name``."""

Name = Annotated[str, Field(pattern=f"^{NAME_PATTERN}$", max_length=64)]
"""Name that can be part of the name of a file or folder."""

MAX_TOPIC_NAME_CHARS: Final = 40
"""Maximum length of a ``TopicName``."""

TopicName = Annotated[str, Field(pattern="^[a-z][a-z0-9_]*$", max_length=MAX_TOPIC_NAME_CHARS)]
"""Name that can be part of a topic and of a frame, and of the name of a file."""
