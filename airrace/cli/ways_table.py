"""A table of the routes that were tried."""

from rich import box
from rich.table import Table
from rich.text import Text

from airrace.procedure.result import SearchReport

SHOWN = 12
"""The largest number of ways in the table; all of them are in the checkpoint and in the object."""


def ways_table(explored: SearchReport) -> Table:
    """Return a table of the best way and those that came next, with what they cost."""
    starts = f"{explored.led} of {explored.led + explored.elsewhere + explored.lost} flights led to the best"
    title = f"routes: {len(explored.ways)} tried in {explored.seconds:.1f} s, {starts}"
    table = Table(
        title=Text(title), title_justify="left", box=box.SIMPLE, pad_edge=False, collapse_padding=True, show_edge=False
    )
    table.add_column("way", overflow="fold")
    for name in ("rough time\ns", "behind\ns"):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("priced", no_wrap=True)
    for number, way in enumerate(explored.ways[:SHOWN]):
        behind = "best" if number == 0 else f"{way.difference:+.3f}"
        table.add_row(Text(way.text), f"{way.race_time:.3f}", behind, way.priced)
    if len(explored.ways) > SHOWN:
        table.add_row(Text(f"and {len(explored.ways) - SHOWN} more"), "", "", "")
    return table
