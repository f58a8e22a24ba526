import pytest

from simbev_ros.foundation.on_demand import OnDemand


def test_items_are_made_once_when_they_are_first_used():
    made = []

    def make(index):
        made.append(index)
        return 10 * index

    items = OnDemand(4, make)
    assert len(items) == 4
    assert made == []
    assert (items[2], items[2], items[-2]) == (20, 20, 20)
    assert made == [2]
    assert items[1:3] == [10, 20]
    assert list(items) == [0, 10, 20, 30]
    assert sorted(made) == [0, 1, 2, 3]


def test_an_index_beyond_the_end_is_refused():
    with pytest.raises(IndexError):
        OnDemand(2, str)[2]
