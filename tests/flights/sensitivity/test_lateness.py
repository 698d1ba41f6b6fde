"""Prices of lateness: nothing for no delay, the more the later, and the time of a race that is flown on from there."""

import json
from pathlib import Path

import pytest
from example_flights import half_cuban
from typer.testing import CliRunner

from airrace.cli.main import app
from airrace.flights.sensitivity import LatenessPrice
from airrace.flights.sensitivity.lateness import lateness_prices

PULL = 1.4
"""When the point mass begins to pull up, s after the start."""


def price(delay: float) -> LatenessPrice:
    view = half_cuban()["point-mass"]
    (answer,) = lateness_prices([PULL], view.inputs.race, view.inputs.settings, view.result, delay)
    return answer


def test_no_delay_costs_nothing_and_a_longer_one_costs_more() -> None:
    none, short, long = (price(delay) for delay in (1e-3, 0.1, 0.3))
    assert none.late is not None
    assert short.late is not None
    assert long.late is not None
    assert none.late == pytest.approx(0.0, abs=1e-3)
    assert none.early == pytest.approx(0.0, abs=1e-3)
    assert 1e-3 < short.late < long.late
    # The optimum is flat: an error costs its square, where no limit makes it cost more.
    assert long.late > 3.0 * short.late


def test_an_act_at_the_start_cannot_be_early() -> None:
    view = half_cuban()["point-mass"]
    (first,) = lateness_prices([0.0], view.inputs.race, view.inputs.settings, view.result)
    assert first.early is None
    assert first.late is not None


def test_who_rolls_too_early_at_a_gate_that_prescribes_a_bank_misses_it() -> None:
    """The half Cuban eight is left by a roll out of inverted flight: a tenth of a second earlier it is another gate."""
    view = half_cuban()["point-mass"]
    race, settings, result = view.inputs.race, view.inputs.settings, view.result
    passings = result.trajectory.time[result.trajectory.first_node][1:-1].tolist()
    before, at_gate, after = zip(
        *(lateness_prices([time - 0.3, time, time + 0.3], race, settings, result) for time in passings), strict=True
    )
    for price in (*before, *after, *at_gate):  # what breaks a limit at the moment of the mistake is a fact: it may gain
        assert price.early is None or price.early > -5e-3
        assert price.late is None or price.late > -5e-3
    assert any(price.early is None or price.early > 0.01 for price in at_gate)


def test_the_command_tells_the_price_of_every_cue(tmp_path: Path) -> None:
    stored = str(half_cuban().save(tmp_path / "run.h5"))
    result = CliRunner().invoke(app, ["brief", stored, "--lateness", "--json"])
    assert result.exit_code == 0
    cues = json.loads(result.stdout)["cues"]
    pull = min(cues, key=lambda cue: abs(cue["time_s"] - PULL))
    assert pull["delay_s"] == 0.1
    assert 0.0 <= pull["late_s"] < 0.1
    assert all({"late_s", "early_s"} <= set(cue) for cue in cues)
