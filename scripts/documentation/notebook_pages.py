"""A notebook with its stored outputs as a page; nothing is executed."""

import json
from pathlib import Path
from typing import Any

# Any: JSON of any shape.
Cell = dict[str, Any]


def notebook_page(path: Path) -> str:
    """The cells of a notebook in their order, as Markdown: texts as they are, code in blocks, outputs below."""
    cells: list[Cell] = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return "\n\n".join(part for cell in cells for part in _parts(cell)) + "\n"


def _parts(cell: Cell) -> list[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] == "markdown":
        return [source]
    return [_block(source, "python"), *(_output(one) for one in cell["outputs"])]


def _output(output: Cell) -> str:
    """The richest form of an output that a page can show."""
    if output["output_type"] == "stream":
        return _block("".join(output["text"]), "text")
    data = output["data"]
    if "image/png" in data:
        encoded = "".join(data["image/png"]).replace("\n", "")
        return f'<img alt="Output of the cell above" src="data:image/png;base64,{encoded}">'
    if "text/html" in data:
        # A blank line would end the block of HTML.
        lines = "".join(data["text/html"]).splitlines()
        return "<div>\n" + "\n".join(line for line in lines if line.strip()) + "\n</div>"
    return _block("".join(data["text/plain"]), "text")


def _block(text: str, language: str) -> str:
    return f"```{language}\n{text.rstrip()}\n```"
