"""A sequence whose items are made when they are first asked for."""

from collections.abc import Callable, Sequence
from typing import Generic, TypeVar, overload

_T = TypeVar("_T")


class OnDemand(Sequence[_T], Generic[_T]):
    """Sequence of ``count`` items, each made by ``make(index)`` when it is first used, and then kept.

    It is for what few scenes need all of, such as meshes of every vehicle there is.
    """

    def __init__(self, count: int, make: Callable[[int], _T]) -> None:
        self._count, self._make = count, make
        self._made: dict[int, _T] = {}

    def __len__(self) -> int:
        return self._count

    @overload
    def __getitem__(self, index: int) -> _T: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[_T]: ...
    def __getitem__(self, index: int | slice) -> _T | Sequence[_T]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(self._count))]
        position = range(self._count)[index]
        if position not in self._made:
            self._made[position] = self._make(position)
        return self._made[position]
