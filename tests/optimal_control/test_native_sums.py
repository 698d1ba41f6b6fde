"""The native library's sums have the bits of numpy's."""

import numpy as np
import pytest

from airrace.optimal_control import sparse_assembly as module
from airrace.optimal_control.sparse_assembly import COOBuilder, SparseAssembly


@pytest.fixture
def sums() -> SparseAssembly:
    """Sums of one to about ten numbers, of sizes that differ by many orders."""
    random = np.random.default_rng(3)
    contributions = COOBuilder(20, 30)
    for count in (300, 2000):
        contributions.draw_from(500)
        weights = random.normal(size=count) * 10.0 ** random.integers(-9, 9, count)
        rows, columns = random.integers(0, 20, count), random.integers(0, 30, count)
        contributions.add(rows, columns, weights, random.integers(0, 500, count))
    return contributions.sums()


def by_numpy(sums: SparseAssembly, drawn: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> np.ndarray:
    assert module.library() is not None
    with monkeypatch.context() as patch:
        patch.setattr(module, "library", lambda: None)
        return sums.of(drawn)


def test_sums_have_the_bits_of_numpy(sums: SparseAssembly, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(sums.turns) > 3
    drawn = np.random.default_rng(4).normal(size=1000)
    expected = by_numpy(sums, drawn, monkeypatch)
    assert sums.of(drawn).tobytes() == expected.tobytes()
    places = np.random.default_rng(5).permutation(2 * len(expected))[: len(expected)]
    memory = np.full(2 * len(expected), np.pi)
    assert sums.into(drawn, memory, places)
    assert memory[places].tobytes() == expected.tobytes()
    assert (np.delete(memory, places) == np.pi).all()


def test_chosen_sums_have_the_bits_of_numpy(sums: SparseAssembly, monkeypatch: pytest.MonkeyPatch) -> None:
    random = np.random.default_rng(6)
    numbers = np.sort(random.integers(0, len(sums.rows), 400))
    chosen, drawn = sums.chosen(numbers, random.normal(size=400)), random.normal(size=1000)
    assert chosen.of(drawn).tobytes() == by_numpy(chosen, drawn, monkeypatch).tobytes()


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf])
def test_both_tell_what_is_no_number(sums: SparseAssembly, number: float, monkeypatch: pytest.MonkeyPatch) -> None:
    drawn, memory = np.ones(1000), np.zeros(len(sums.rows))
    drawn[int(sums.turns[-1].sources[0])] = number  # the last summand of a sum
    places = np.arange(len(memory))
    assert not sums.into(drawn, memory, places)
    monkeypatch.setattr(module, "library", lambda: None)
    assert not sums.into(drawn, memory, places)
    assert sums.into(np.ones(1000), memory, places)
