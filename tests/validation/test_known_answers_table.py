"""The table's verdict is its exit code, and the documentation shows what it prints."""

import re
from dataclasses import replace
from pathlib import Path

import double_integrator
import known_answers as script
import pytest
import reorientation

ROOT = Path(__file__).parents[2]
EVIDENCE = ROOT / "docs" / "evidence" / "known_answers.md"


def table(text: str) -> list[dict[str, str]]:
    """The first table in Markdown."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


def shown(mark: str) -> list[dict[str, str]]:
    """The table below a mark in the documentation."""
    (text,) = re.findall(rf"<!-- {mark} -->\n((?:\|.*\n)+)", EVIDENCE.read_text(encoding="utf-8"))
    return table(text)


def test_the_docs_show_what_the_script_finds(capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["--markdown"]) == 0
    printed, written = table(capsys.readouterr().out), shown("known answers")
    assert len(printed) == len(written)
    for ours, theirs in zip(printed, written, strict=True):
        same = theirs.keys() - {"ours", "difference"}
        assert {key: ours[key] for key in same} == {key: theirs[key] for key in same}
        last = 10.0 ** -len(theirs["ours"].partition(".")[2])
        # a solver stops a little elsewhere with other libraries; its tolerance is 1e-9
        near = max(2 * last, 2e-9)
        assert float(theirs["ours"]) == pytest.approx(float(ours["ours"]), abs=near)
        difference = float(theirs["ours"]) - float(theirs["published"])
        assert float(theirs["difference"]) == pytest.approx(difference, rel=0.05, abs=2 * last)


def test_the_docs_show_the_orders_that_are_observed(capsys: pytest.CaptureFixture[str]) -> None:
    assert script.main(["--orders", "--markdown"]) == 0
    printed, written = table(capsys.readouterr().out), shown("orders")
    assert [list(row) for row in printed] == [list(row) for row in written]
    for ours, theirs in zip(printed, written, strict=True):
        assert ours.pop("integrator") == theirs.pop("integrator")
        assert [float(cell) for cell in theirs.values()] == pytest.approx(
            [float(cell) for cell in ours.values()], abs=0.02
        )


def test_answers_outside_their_tolerance_and_unsolved_problems_fail(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (answer,) = double_integrator.known_answers()
    (value,) = answer.values
    strict = replace(answer, values=(replace(value, tolerance=1e-12),))
    hasty = replace(answer, options=replace(answer.options, iterations_max=1))
    for one, code in ((answer, 0), (strict, 1), (hasty, 1)):
        monkeypatch.setattr(script, "known_answers", lambda one=one: (one,))
        assert script.main([]) == code
        assert ("NO" in capsys.readouterr().out) is (code == 1)
    monkeypatch.setattr(script, "known_answers", lambda: (strict,))
    assert script.main(["--markdown"]) == 1
    assert "does not hold: double integrator" in capsys.readouterr().err
    boasting = tuple(replace(scheme, order=scheme.order + 1) for scheme in script.SCHEMES[:1])
    monkeypatch.setattr(script, "SCHEMES", boasting)
    assert script.main(["--orders"]) == 1
    assert "NO" in capsys.readouterr().out


def test_finer_meshes_keep_the_answer(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(script, "known_answers", reorientation.known_answers)
    assert script.main(["--refine", "--markdown"]) == 0
    rows = table(capsys.readouterr().out)
    assert [row["intervals"] for row in rows] == ["6 x 4", "6 x 8", "6 x 16"]
    assert [float(row["ours"]) for row in rows] == pytest.approx([28.6304] * 3, abs=5e-5)
