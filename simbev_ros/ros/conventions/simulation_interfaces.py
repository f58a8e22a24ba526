"""How this graph answers to simulation_interfaces, the standard services of simulators: names, results, filters."""

import re
from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any

from simbev_ros.foundation.errors import InputError, SimbevError, foreign_content

RUN_STATUS, DELETE_SPAWNED = "/world/run_status", "/world/delete_spawned"
"""Services of the world node, of type std_srvs/Trigger: the JSON of ``run_status``; the end of all spawned entities."""

Act = Callable[[Any, Any], None]
"""Acts on a request and fills in the response, or raises ``Refused``."""


class Refused(InputError):
    """A request cannot be fulfilled; the message says why.

    Attributes:
        code: Name of the code: a constant of the response, or of Result.
    """

    def __init__(self, code: str, message: str) -> None:
        super().__init__(message)
        self.code = code


def has_simulation_interfaces() -> bool:
    """Whether the package is installed."""
    return find_spec("simulation_interfaces") is not None


def service_name(kind: str) -> str:
    """Name of the service or action of a type, such as /get_entities of GetEntities."""
    return "/" + re.sub(r"(?<!^)(?=[A-Z])", "_", kind).lower()


def refused_result(result: Any, response: Any, error: SimbevError) -> Any:
    """Fill in a Result with why a request for a response was refused; return it."""
    code = error.code if isinstance(error, Refused) else "RESULT_OPERATION_FAILED"
    result.result = getattr(response, code, None) or getattr(result, code)
    result.error_message = str(error)
    return result


def answering(act: Act) -> Callable[[Any, Any], Any]:
    """Callback of a service: whatever a request holds, its answer is a response with a result."""

    def answer(request: Any, response: Any) -> Any:
        result = getattr(response, "result", None)
        try:
            with foreign_content("request"):
                act(request, response)
        except SimbevError as error:
            blank = type(response)()
            refused_result(blank.result, response, error)
            if isinstance(getattr(response, "results", None), list):  # of each part, which says more
                blank.results = response.results
            return blank
        if result is not None and not result.result:
            result.result = result.RESULT_OK
        return response

    return answer


def tags_match(tags: Sequence[str], wanted: Any) -> bool:
    """Whether tags pass a TagsFilter."""
    if not wanted.tags:
        return True
    return (all if wanted.filter_mode == wanted.FILTER_MODE_ALL else any)(tag in tags for tag in wanted.tags)
