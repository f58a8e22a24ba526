"""The base of all configuration models: frozen; unknown keys, NaN and infinity are refused."""

from pydantic import BaseModel, ConfigDict


class Model(BaseModel):
    """Base of every configuration model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
