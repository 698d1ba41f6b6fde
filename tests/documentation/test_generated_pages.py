"""Pages that are made from the program say all that the program says."""

import json
from pathlib import Path
from types import ModuleType
from typing import Any

import griffe
import pytest
import typer.main
import yaml
from pages import DOCS, ROOT

from airrace.cli.main import app
from airrace.inputs.json_schema import LANGUAGES, json_schema

Modules = dict[str, ModuleType]
Node = Any  # Any: JSON of any shape


def properties(node: Node) -> list[tuple[str, str]]:
    """Every key of a schema with its meaning, at any depth."""
    if isinstance(node, list):
        return [found for one in node for found in properties(one)]
    if not isinstance(node, dict):
        return []
    own = [(key, one.get("description", "")) for key, one in node.get("properties", {}).items()]
    return own + [found for one in node.values() for found in properties(one)]


def test_the_page_of_commands_has_every_command_argument_option_and_meaning(generators: Modules) -> None:
    page = " ".join(generators["command_pages"].commands_page().replace("\\|", "|").split())
    count = 0
    for name, command in generators["command_pages"].commands():
        assert f"## {name} " in page
        assert " ".join(command.help.split()) in page, name
        for parameter in command.params:
            count += 1
            assert parameter.help, f"{name}: {parameter.name} is not explained"
            assert parameter.help in page, f"{name}: {parameter.name}"
            assert all(f"`{option}" in page or f", {option}" in page for option in parameter.opts if option[0] == "-")
    assert count > 60


def test_the_page_of_commands_has_every_command_that_there_is(generators: Modules) -> None:
    words = {name.split()[1] for name, _ in generators["command_pages"].commands()}
    assert words == set(getattr(typer.main.get_command(app), "commands", {}))


@pytest.mark.parametrize("language", LANGUAGES)
def test_the_page_of_a_language_has_every_key_with_its_meaning(generators: Modules, language: str) -> None:
    lines = generators["language_pages"].language_page(language).splitlines()
    keys = properties(json_schema(language))
    assert len(keys) > 5
    for key, meaning in keys:
        assert meaning, f"{key} is not explained"
        assert any(line.startswith(f"| `{key}` |") and line.endswith(f"| {meaning} |") for line in lines), key


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_part_of_a_language_has_a_place_that_links_lead_to(generators: Modules, language: str) -> None:
    page = generators["language_pages"].language_page(language)
    assert all(f"{{ #{name} }}" in page for name in json_schema(language)["definitions"])


def test_values_are_described_in_words(generators: Modules) -> None:
    page = generators["language_pages"].language_page("track")
    assert "| `bank` | `right` or `left` or `either` | `either` | the wing that points down |" in page
    assert "| `laps` | whole number from 1 to 100 |  | how often the lap is flown; once by default |" in page
    assert "| `n_z_max` | number above 1 and at most 25 |" in page
    assert "A bare text stands for a mapping with this text as its `gate`." in page
    assert "| `each_lap` | list of: list of: [flown](#FlownEntry), at most 10000, at most 100 |" in page


def test_formulas_become_mathml(generators: Modules) -> None:
    html = '<p>With <span class="arithmatex">\\(a &lt; b\\)</span>:</p><div class="arithmatex">\\[\\frac{1}{2}\\]</div>'
    page = generators["mathml"].with_formulas(html)
    assert page.count("<math ") == 2
    assert 'display="block"' in page
    assert "<mfrac>" in page
    assert "&lt;" in page or "&#x0003C;" in page
    assert "arithmatex" not in page


def test_a_notebook_becomes_a_page_with_its_outputs(generators: Modules, tmp_path: Path) -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "text"]},
        {
            "cell_type": "code",
            "source": "print(1)",
            "outputs": [
                {"output_type": "stream", "text": ["1\n"]},
                {"output_type": "display_data", "data": {"image/png": "QUJD\nREVG", "text/plain": "<Figure>"}},
                {"output_type": "execute_result", "data": {"text/html": ["<b>\n", "\n", "x</b>"], "text/plain": "x"}},
                {"output_type": "execute_result", "data": {"text/plain": ["42"]}},
            ],
        },
    ]
    path = tmp_path / "one.ipynb"
    path.write_text(json.dumps({"cells": cells}), encoding="utf-8")
    assert generators["notebook_pages"].notebook_page(path).split("\n\n") == [
        "# Title\ntext",
        "```python\nprint(1)\n```",
        "```text\n1\n```",
        '<img alt="Output of the cell above" src="data:image/png;base64,QUJDREVG">',
        "<div>\n<b>\nx</b>\n</div>",
        "```text\n42\n```\n",
    ]


def test_documents_of_the_root_keep_their_links(generators: Modules) -> None:
    text = "[a](docs/routes.md) [b](ARCHITECTURE.md) [c](#d)"
    expected = "[a](../routes.md) [b](../project/architecture.md) [c](#d)"
    assert generators["site_hooks"].moved(text) == expected


def test_a_flow_chart_becomes_a_table_of_its_arrows(generators: Modules) -> None:
    chart = """flowchart LR
    subgraph all ["everything"]
        a[(A,<br/>first)] & b -- "x, y" --> c --> d["D"]
    end
    c <-- "pipe" --> a
    b -. "dots" .-> d
"""
    rows = generators["flow_tables"].with_tables(f"before\n\n```mermaid\n{chart}```\n\nafter").splitlines()
    assert rows == [
        "before",
        "",
        "| from | what flows | to |",
        "|---|---|---|",
        "| A, first | x, y | c |",
        "| b | x, y | c |",
        "| c |  | D |",
        "| c | pipe | A, first |",
        "| A, first | pipe | c |",
        "| b | dots | D |",
        "",
        "after",
    ]


def test_the_chart_of_the_architecture_is_a_table_in_the_site(generators: Modules) -> None:
    text = generators["site_hooks"].moved((ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8"))
    assert "mermaid" not in text
    assert "| procedure | Problem, guess | optimal_control |" in text


def test_names_that_share_a_description_get_one_each(generators: Modules) -> None:
    docstring = "What it is.\n\nAttributes:\n    x, y: position,\n        m.\n    z: height.\n"
    expected = (
        "What it is.\n\nAttributes:\n    x: position,\n        m.\n    y: position,\n        m.\n    z: height.\n"
    )
    assert generators["grouped_names"].separated(docstring) == expected


def test_the_parameters_of_a_record_are_shown() -> None:
    extensions = griffe.load_extensions(ROOT / "scripts" / "documentation" / "records.py")
    package = griffe.load("airrace", extensions=extensions, search_paths=[ROOT])
    plain, by_name = package["quantities.Quantity"], package["quantities.Vector"]
    assert [one.name for one in plain.parameters][:4] == ["self", "name", "unit", "scale"]
    assert "dataclass" in plain.labels
    assert "dataclass" in by_name.labels


def test_every_page_stands_in_the_navigation(generators: Modules) -> None:
    text = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
    pages = {page for title in yaml.safe_load(text)["nav"] for page in leaves(title)}
    written = {str(path.relative_to(DOCS)) for path in DOCS.rglob("*.md")}
    notebooks = {f"notebooks/{path.stem}.md" for path in DOCS.rglob("*.ipynb")}
    generated = {"reference/api.md", "reference/commands.md", *(f"reference/{language}.md" for language in LANGUAGES)}
    assert pages == written | notebooks | generated | set(generators["site_hooks"].ROOT_DOCUMENTS.values())


def leaves(node: Node) -> list[str]:
    if isinstance(node, str):
        return [node]
    return [leaf for one in (node.values() if isinstance(node, dict) else node) for leaf in leaves(one)]
