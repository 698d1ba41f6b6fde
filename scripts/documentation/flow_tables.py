"""Flow charts as tables: a page of the site has no script that could draw a chart in the language of Mermaid."""

import re

CHART = re.compile(r"^```mermaid\nflowchart \w+\n(.*?)^```$", re.MULTILINE | re.DOTALL)
ARROW = re.compile(r"\s*(?P<both><)?-[-.]\s*(?:\"(?P<label>[^\"]*)\"\s*[-.]?-)?>?[-.]?>\s*")
NODE = re.compile(r"(?P<name>\w+)(?:\[\(?\"?(?P<text>.*?)\"?\)?\])?$")
HEADING = ["| from | what flows | to |", "|---|---|---|"]


def with_tables(text: str) -> str:
    """A document with its flow charts as tables of their arrows."""
    return CHART.sub(lambda found: flow_table(found[1]), text)


def flow_table(chart: str) -> str:
    """The arrows of a flow chart, a row for each; `a & b --> c` is two of them, and so is `a --> b --> c`."""
    texts: dict[str, str] = {}
    rows: list[tuple[str, str, str]] = []
    for line in chart.splitlines():
        arrows = list(ARROW.finditer(line))
        ends = [[_name(node, texts) for node in part.split(" & ")] for part in _between(line, arrows)]
        for arrow, begins, goals in zip(arrows, ends, ends[1:], strict=False):
            flow = arrow["label"] or ""
            rows += [(begin, flow, goal) for begin in begins for goal in goals]
            rows += [(goal, flow, begin) for begin in begins for goal in goals if arrow["both"]]
    lines = [f"| {texts.get(begin, begin)} | {flow} | {texts.get(goal, goal)} |" for begin, flow, goal in rows]
    return "\n".join([*HEADING, *lines])


def _between(line: str, arrows: list[re.Match[str]]) -> list[str]:
    """What stands before, between and behind the arrows of a line; nothing if there are none."""
    if not arrows:
        return []
    starts = [0, *(arrow.end() for arrow in arrows)]
    stops = [*(arrow.start() for arrow in arrows), len(line)]
    return [line[start:stop].strip() for start, stop in zip(starts, stops, strict=True)]


def _name(node: str, texts: dict[str, str]) -> str:
    """The name of a node; the text that it is shown with is noted."""
    found = NODE.fullmatch(node)
    if found is None:
        raise ValueError(f"{node!r} is not a node of a flow chart")
    if found["text"]:
        texts[found["name"]] = found["text"].replace("<br/>", " ")
    return found["name"]
