import numpy as np
import pytest

from companion.planning.random_numbers import draw_seed, seeded, uniform, whole

WORD = 2**64


def splitmix64(state):
    """The published generator in whole Python numbers: (new state, output)."""
    state = (state + 0x9E3779B97F4A7C15) % WORD
    z = state
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9 % WORD
    z = (z ^ (z >> 27)) * 0x94D049BB133111EB % WORD
    return state, z ^ (z >> 31)


@pytest.mark.parametrize("seed", [0, 1, 2**63 - 1])
def test_the_numbers_are_splitmix64s(seed):
    compiled, plain = seeded(seed), seed
    for _ in range(50):
        plain, output = splitmix64(plain)
        assert uniform(compiled) == (output >> 11) / 2**53


def test_whole_numbers_cover_their_range_evenly():
    state = seeded(5)
    draws = np.array([whole(state, -3, 3) for _ in range(7000)])
    counts = np.bincount(draws + 3)
    assert len(counts) == 7
    assert np.abs(counts - 1000).max() < 150  # five standard deviations
    assert whole(state, 4, 4) == 4 and whole(state, 4, 3) == 4


def test_seeds_come_from_the_generator_handed_in():
    assert draw_seed(np.random.default_rng(1)) == draw_seed(np.random.default_rng(1))
    assert draw_seed(np.random.default_rng(1)) != draw_seed(np.random.default_rng(2))
    assert all(0 <= draw_seed(np.random.default_rng(seed)) < 2**63 for seed in range(20))
