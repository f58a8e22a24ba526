"""Reads the section ``evaluation`` of a configuration file, which need not have the others."""

from pathlib import Path

from pydantic import ValidationError

from simbev_ros.config.base import first_problem
from simbev_ros.config.evaluation import Evaluation
from simbev_ros.config.load import find_config
from simbev_ros.config.yaml_file import YamlFile
from simbev_ros.foundation.errors import FOREIGN_ERRORS, InputError

_SECTION = "evaluation"


def load_evaluation(path_or_name: str | Path) -> Evaluation:
    """Load the section of the configuration at a path, or of the shipped one with that name.

    Raises:
        InputError: There is no such file, it has no such section, or the section is invalid.
    """
    file = YamlFile(find_config(path_or_name))
    if not isinstance(file.data, dict) or _SECTION not in file.data:
        raise InputError(f"{file.path}: has no section {_SECTION}")
    try:
        return Evaluation.model_validate(file.data[_SECTION])
    except ValidationError as error:
        line = file.line_of((_SECTION, *error.errors()[0]["loc"])) or 1
        raise InputError(f"{file.path}:{line}: {_SECTION}.{first_problem(error)}") from None
    except FOREIGN_ERRORS as error:
        raise InputError(f"{file.path}: {_SECTION}: {first_problem(error)}") from None
