"""Errors that samples share are estimated from all passings together, and judged with what is left of them."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, imported, known

from airrace.flights.logs.errors import HEIGHT_OFFSET, CommonErrors, Receiver, Window
from airrace.flights.logs.quality import ReceiverAccuracy
from airrace.flights.logs.violations import CERTAIN_DEVIATIONS

EXACT = fixes(20.0, noise=0.02, gap=(0.0, 0.0))
SHIFTS = [(0.0, 0.0, 12.0), (0.0, 0.0, -12.0), (0.0, 0.0, 2.0), (10.0, 0.0, 0.0), (-7.0, 7.0, 5.0), (0.0, -5.0, 0.0)]


def errors(windows: Sequence[Window], stated: float | None = None) -> CommonErrors:
    time = np.array([0.0, 100.0])
    across = np.full(2, stated or 2.5)
    accuracy = ReceiverAccuracy(across, across, "stated" if stated else "")
    return CommonErrors(Receiver(time, accuracy, stated=stated is not None), windows)


def height(number: int, error: float, half: float = 0.0, deviation: float = 0.1) -> Window:
    """A passing, 3 s after the one before it, that is legal with an error within `half` of `error`."""
    name = f"1:g{number}"
    return Window(name, name, 3.0 * number, (0.0, 0.0, 1.0), error - half, error + half, deviation)


def moved(seen: Fixes, shift: tuple[float, float, float]) -> Fixes:
    return Fixes(seen.time, seen.north + shift[0], seen.east + shift[1], seen.height + shift[2])


def drift(deviation: float, seed: int, time: np.ndarray) -> np.ndarray:
    """A first-order Gauss-Markov error of 20 s."""
    random = np.random.default_rng(seed)
    error = deviation * random.standard_normal(len(time))
    for row, kept in enumerate(np.exp(-np.diff(time) / 20.0).tolist(), start=1):
        error[row] = kept * error[row - 1] + math.sqrt(1.0 - kept**2) * error[row]
    return error


def test_without_breaches_and_windows_it_is_the_linear_gaussian_prediction() -> None:
    """Passings of no width are measurements: mean and deviation of a prediction are those of a Gaussian process."""
    random = np.random.default_rng(3)
    rows = [height(number, error) for number, error in enumerate(0.3 * random.standard_normal(6))]
    judged = height(2, 0.5)
    others = [row for row in rows if row.passing != judged.passing]
    times = np.array([row.time for row in others])
    kept = np.exp(-np.abs(times[:, None] - times) / 20.0)
    K = HEIGHT_OFFSET**2 + 2.4**2 * kept + 0.1**2 * np.eye(5)
    k = HEIGHT_OFFSET**2 + 2.4**2 * np.exp(-np.abs(times - judged.time) / 20.0)
    mean = k @ np.linalg.solve(K, [row.lower for row in others])
    variance = HEIGHT_OFFSET**2 + 2.4**2 - k @ np.linalg.solve(K, k)
    judgement = errors(rows).judge(judged)
    assert judgement.shift == pytest.approx(mean, abs=2e-3)
    assert judgement.deviations == pytest.approx(abs(0.5 - mean) / math.sqrt(variance + 0.1**2), rel=1e-2)


def test_an_offset_of_all_passings_is_no_breach_and_one_passing_that_differs_is() -> None:
    rows = [height(number, 8.0, 1.0) for number in range(8)]
    assert all(errors(rows).judge(row).deviations < 0.5 for row in rows)
    odd = height(3, 30.0, 1.0)
    rows[3] = odd
    assert errors(rows).judge(odd).deviations > CERTAIN_DEVIATIONS
    assert all(errors(rows).judge(row).deviations < 1.0 for row in rows if row is not odd)


def test_of_two_passings_that_disagree_neither_is_certain() -> None:
    """One of them is a breach, and nothing says which."""
    rows = [height(0, 0.0, 1.0), height(1, 30.0, 1.0)]
    assert all(errors(rows).judge(row).deviations < CERTAIN_DEVIATIONS for row in rows)


def test_the_farther_a_passing_is_off_the_more_deviations_it_is() -> None:
    rows = [height(number, 0.0, 5.0) for number in range(10)]
    judged = [errors(rows).judge(height(4, error, 5.0)).deviations for error in np.arange(0.0, 40.0, 0.5)]
    assert judged[0] == 0.0
    assert all(later >= earlier - 1e-2 for earlier, later in itertools.pairwise(judged))
    assert judged[-1] > CERTAIN_DEVIATIONS


@pytest.mark.parametrize("shift", SHIFTS)
def test_a_survey_or_a_zero_of_heights_that_is_off_accuses_nobody(shift: tuple[float, float, float]) -> None:
    flown = imported(csv_text(moved(EXACT, shift)))
    assert [breach for breach in flown.violations if breach.certain] == []
    assert any("almost all passings are about" in remark for remark in flown.remarks)
    for crossing in flown.flight.crossings:  # times, too, are those of the course
        true = known().passings[crossing.name] - known().passings["0:g0"]
        assert abs(crossing.time - true) < 4.0 * math.hypot(flown.known[crossing.name].time, flown.known["0:g0"].time)


@pytest.mark.parametrize("seed", [1, 2])
def test_a_slow_receiver_accuses_nobody(seed: int) -> None:
    wandering = [drift(deviation, 10 * seed + axis, EXACT.time) for axis, deviation in enumerate((1.5, 1.5, 2.4))]
    places = (EXACT.north, EXACT.east, EXACT.height)
    flown = imported(csv_text(Fixes(EXACT.time, *(a + b for a, b in zip(places, wandering, strict=True)))))
    assert [breach for breach in flown.violations if breach.certain] == []


@pytest.mark.parametrize("shift", SHIFTS[::2])
def test_a_gate_that_is_passed_far_too_high_stays_found_among_common_errors(shift: tuple[float, float, float]) -> None:
    off = np.abs(EXACT.time - known().passings["1:g4"])
    bump = 30.0 * np.where(off < 1.2, np.cos(0.5 * np.pi * np.minimum(off / 1.2, 1.0)) ** 2, 0.0)
    flown = imported(csv_text(moved(replace(EXACT, height=EXACT.height + bump), shift)))
    certain = [breach for breach in flown.violations if breach.certain]
    assert {breach.passing for breach in certain} == {"1:g4"}
    assert "too-high" in {breach.rule for breach in certain}


def test_a_gate_that_both_laps_miss_by_the_same_vector_seems_to_stand_elsewhere() -> None:
    """Passed in both directions, 9 m beside the place in the file."""
    places = [EXACT.north.copy(), EXACT.east.copy()]
    for name in ("1:g4", "1:g4#2"):
        off = np.abs(EXACT.time - known().passings[name])
        side = known().at("chi", np.array([known().passings["1:g4"]]))[0] + 0.5 * np.pi
        bump = 12.0 * np.where(off < 1.5, np.cos(0.5 * np.pi * np.minimum(off / 1.5, 1.0)) ** 2, 0.0)
        places = [place + bump * part for place, part in zip(places, (np.cos(side), np.sin(side)), strict=True)]
    flown = imported(csv_text(Fixes(EXACT.time, *places, EXACT.height)), accuracy=0.02)
    assert any("g4 seems to stand" in remark for remark in flown.remarks)
    assert not [breach for breach in flown.violations if breach.certain and "g4" in breach.passing]


@pytest.mark.parametrize("deviation", [0.02, 1.0, 3.0, 8.0])
def test_a_receiver_that_states_its_accuracy_accuses_nobody(deviation: float) -> None:
    """The study of many logs is `scripts/experiments/noisy_logs.py`."""
    wandering = [drift(ratio * deviation, axis + 40, EXACT.time) for axis, ratio in enumerate((1.0, 1.0, 1.6))]
    places = (EXACT.north, EXACT.east, EXACT.height)
    text = csv_text(Fixes(EXACT.time, *(a + b for a, b in zip(places, wandering, strict=True))))
    head, *rows = text.splitlines()
    quality = f"{deviation},{1.6 * deviation}"
    flown = imported("\n".join([f"{head},hAcc [m],vAcc [m]", *(f"{row},{quality}" for row in rows)]) + "\n")
    assert [breach for breach in flown.violations if breach.certain] == []
