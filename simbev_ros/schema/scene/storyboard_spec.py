"""Specification of a scene that an OpenSCENARIO file prescribes."""

from pydantic import Field

from simbev_ros.config.base import Model

MAX_DOCUMENT_CHARS = 16 << 20
MAX_CAST = 1000
MAX_NAME_CHARS = 200


class CastSpec(Model):
    """An entity of the scenario, and the model that plays it."""

    name: str = Field(max_length=MAX_NAME_CHARS)
    blueprint: str = Field(max_length=200)


class StoryboardSpec(Model):
    """The scenario of a scene, without references to other files."""

    document: str = Field(
        max_length=MAX_DOCUMENT_CHARS, description="OpenSCENARIO XML 1.3 without parameters and catalogs"
    )
    cast: tuple[CastSpec, ...] = Field(
        min_length=1, max_length=MAX_CAST, description="all entities; the first one is the first agent's vehicle"
    )
