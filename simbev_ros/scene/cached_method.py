"""A decorator that caches results of methods in their object, so that they are freed together with it."""

from collections.abc import Callable
from functools import lru_cache, partial, wraps
from typing import Any, Concatenate, ParamSpec, TypeVar

_Object = TypeVar("_Object")
_Parameters = ParamSpec("_Parameters")
_Result = TypeVar("_Result")
_Method = Callable[Concatenate[_Object, _Parameters], _Result]


def cached_method(
    maxsize: int | None = None,
) -> Callable[[_Method[_Object, _Parameters, _Result]], _Method[_Object, _Parameters, _Result]]:
    """Cache a method's most recent ``maxsize`` results (None: all of them) per object.

    The arguments must be hashable. Shallow copies of the object would share the results, so there must be none.
    """

    def decorate(method: _Method[_Object, _Parameters, _Result]) -> _Method[_Object, _Parameters, _Result]:
        name = f"_cached_{method.__name__}"

        @wraps(method)
        def call(self: _Object, /, *args: _Parameters.args, **kwargs: _Parameters.kwargs) -> _Result:
            own: dict[str, Any] = vars(self)
            if name not in own:
                own[name] = lru_cache(maxsize)(partial(method, self))
            return own[name](*args, **kwargs)

        return call

    return decorate
