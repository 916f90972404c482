"""Keys of lifetimes: many at once are those that NumPy's `SeedSequence` gives one by one."""

from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.random import Stream, key, keys


@given(
    seed=st.integers(0, 2**150),
    stream=st.sampled_from(list(Stream)),
    places=st.integers(1, 5).flatmap(
        lambda size: st.lists(st.tuples(*[st.integers(0, 2**32 - 1)] * size), min_size=1, max_size=4)
    ),
)
def test_many_keys_are_those_of_each_place(seed, stream, places):
    assert keys(seed, stream, places).tolist() == [int(key(seed, stream, *place)) for place in places]
