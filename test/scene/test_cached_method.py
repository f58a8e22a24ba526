"""Results of methods are cached per object, up to a number of them."""

from simbev_ros.scene.cached_method import cached_method


class Counter:
    def __init__(self, step: int) -> None:
        self.step, self.calls = step, 0

    @cached_method(maxsize=2)
    def multiple(self, number: int, offset: int = 0) -> int:
        self.calls += 1
        return number * self.step + offset


def test_a_result_is_computed_once_per_object() -> None:
    one, two = Counter(3), Counter(5)
    assert [one.multiple(2), one.multiple(2), two.multiple(2), one.multiple(2, offset=1)] == [6, 6, 10, 7]
    assert (one.calls, two.calls) == (2, 1)


def test_the_least_recent_result_is_dropped() -> None:
    counter = Counter(3)
    for number in (1, 2, 3, 1):
        counter.multiple(number)
    assert counter.calls == 4
