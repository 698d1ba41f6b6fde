"""The section of a report on what a flight lost by the cost to go, with what would have been best from there."""

import numpy as np

from airrace.flights.results.cost_to_go import CostToGoLoss
from airrace.pages.report.sections import note, section, table_section
from airrace.pages.views.comparison_tables import cost_table
from airrace.pages.views.map_model import LOSS_COLOURS, ColouredTrack, map_model
from airrace.pages.views.plain_text import escape_html
from airrace.pages.views.plan_svg import plan_svg

RATE_MIN = 0.05
"""The least range of colours, seconds lost per second."""


def cost_section(loss: CostToGoLoss) -> str:
    """Return the three costliest legs in words, their optimal continuations as ghosts on a map, and a table."""
    flight, ghosts = loss.flight, [leg.best for leg in loss.costliest]
    line = np.stack([flight["x"], flight["y"]], axis=1)
    times = np.array([sample.moment.time for sample in loss.samples])
    reachable = np.array([sample.reachable for sample in loss.samples])
    rates = np.diff(reachable) / np.maximum(np.diff(times), 1e-3)
    rows = np.clip(np.searchsorted(times, flight.time, side="right") - 1, 0, len(rates) - 1)
    most = max(float(np.percentile(np.abs(rates), 98.0)), RATE_MIN)
    ends = f"wins {most:.2f} s each second", f"loses {most:.2f} s"
    coloured = ColouredTrack(line, rates[rows], -most, most, LOSS_COLOURS, ends)
    map_ = map_model(flight.race).with_track(line)
    for leg, ghost in zip(loss.costliest, ghosts, strict=True):
        branch = (ghost.time >= leg.leg.before.time) & (ghost.time <= ghost.crossings[leg.leg.number].time)
        map_ = map_.with_ghost(np.stack([ghost["x"][branch], ghost["y"][branch]], axis=1))
    items = "".join(f"<li>{escape_html(leg.words)}</li>" for leg in loss.costliest)
    listed = f"<p>{escape_html(loss.title)}</p><ol>{items}</ol>"
    words = f"{flight.label} in the colours of what it loses; dashed, the best from where its costliest legs begin."
    plan = f'{listed}<div class="scroll">{plan_svg(map_, coloured)}</div>{note(words)}'
    return section(f"What every moment of {flight.label} cost", plan) + table_section(cost_table(loss))
