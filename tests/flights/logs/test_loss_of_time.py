"""What is told of the time that a recorded flight has lost."""

from pathlib import Path

import numpy as np
import pytest
from synthetic import Fixes, csv_text, fixes, known, race

from airrace.flights.logs.log_flight import flight_from_log
from airrace.flights.logs.reading import read_log
from airrace.flights.results import Flight
from airrace.flights.results.comparison import compare_flights
from airrace.flights.results.time_loss import Cause, time_loss


@pytest.mark.parametrize("seed", [1, 2])
def test_what_is_told_of_a_log_does_not_hang_on_its_noise(seed: int, tmp_path: Path) -> None:
    """The optimum of Rovinj, flown a tenth slower on its fifth leg, is recorded at 20 Hz with 0.5 m of noise."""
    flown = known()
    begin, end = flown.passings["1:g4"], flown.passings["1:g5"]
    seen = fixes(20.0, noise=0.5, seed=seed, gap=(0.0, 0.0))
    slow = seen.time + 0.1 * (np.clip(seen.time, begin, end) - begin)
    log = csv_text(Fixes(slow, seen.north, seen.east, seen.height))
    best = csv_text(fixes(20.0, noise=0.02, seed=3, gap=(0.0, 0.0)))
    flights: list[Flight] = []
    for name, text in (("best", best), ("flown", log)):
        path = tmp_path / f"{name}.csv"
        path.write_text(text)
        flights.append(flight_from_log(read_log(path), race(), label=name).flight)
    first = time_loss(compare_flights(*flights)).costliest[0]
    assert "1:g5" in [leg.name for leg in first.legs]
    assert first.amount == pytest.approx(0.1 * (end - begin), abs=0.03)
    assert first.causes[Cause.LIFT] == 0.0
