"""The base of all configuration models: frozen, unknown keys refused, no NaN or infinity."""

from pydantic import BaseModel, ConfigDict


class Model(BaseModel):
    """Base of every configuration model."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
