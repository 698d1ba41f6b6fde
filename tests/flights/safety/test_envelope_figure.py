"""The envelope of closed-loop flights on the map."""

import re
from dataclasses import replace

import numpy as np
import pytest
from flown_safety_case import case, flown

from airrace.flights.safety.monte_carlo import SafetyResult
from airrace.optimal_control.trajectory import Array
from airrace.pages.views.drawing import figure_address
from airrace.pages.views.safety_views import BANDS, envelope_figure


def with_envelope(lower: float, upper: float) -> SafetyResult:
    """The flights as if all strayed to either side as far all along."""
    result = case().result
    envelope = np.zeros_like(result.envelope)
    envelope[:, 0] = np.array([lower, lower, 0.5 * (lower + upper), upper, upper])[:, None]
    return replace(result, envelope=envelope)


def bands(result: SafetyResult) -> tuple[list[Array], float]:
    """The pieces of both bands on the map, east and north, and how many times as far off they are drawn."""
    figure = envelope_figure(result, flown().flight())
    axes = figure.axes[0]
    drawn = [one for one in axes.collections if type(one).__name__ == "PolyCollection"]
    widening = float(re.search(r"drawn ([\d.]+) times", axes.get_title(loc="left"))[1])  # pyright: ignore[reportOptionalSubscript] it is there
    return [np.array([path.vertices[:4] for path in one.get_paths()]) for one in drawn], widening


def test_bands_lie_beside_the_line_to_the_side_and_as_far_as_is_said() -> None:
    flight = flown().flight()
    for low, high in ((-1.0, 1.0), (0.0, 2.0)):
        (outer, inner), widening = bands(with_envelope(low, high))
        assert len(outer) == len(inner) == len(case().result.clock) - 1
        line = np.stack([np.interp(case().result.clock, flight.time, flight[name]) for name in ("y", "x")], axis=1)
        chi = np.interp(case().result.clock, flight.time, np.unwrap(flight["chi"]))
        right = np.stack([np.cos(chi), -np.sin(chi)], axis=1)
        for corner, at, quantile in ((0, slice(None, -1), low), (2, slice(1, None), high)):
            off = np.einsum("ij,ij->i", outer[:, corner] - line[at], right[at])
            assert off == pytest.approx(np.full(len(off), widening * quantile), abs=0.05 * widening)


def test_a_band_that_is_not_known_is_not_drawn() -> None:
    result = case().result  # too few flights for 99.7 %
    (only,), _ = bands(result)
    assert len(only) == len(result.clock) - 1
    labels = envelope_figure(result, flown().flight()).axes[0].get_legend_handles_labels()[1]
    assert f"{BANDS[1][2]} of the flights" in labels
    assert f"{BANDS[0][2]} of the flights" not in labels


def test_the_same_drawing_has_the_same_address() -> None:
    first, second = (figure_address(envelope_figure(case().result, flown().flight())) for _ in range(2))
    assert first == second
