"""The table of the script is made of what it measures, its exit code is the verdict, and the docs show the table."""

import dataclasses
import importlib
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
TRACK = ROOT / "tracks" / "half_cuban_eight.yaml"
MODULES = ("mesh_comparison", "mesh_refinement", "mesh_refinement_figure")


@pytest.fixture(scope="module")
def script() -> Iterator[ModuleType]:
    """`scripts/mesh_refinement.py`, which imports its neighbours."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "scripts"))
        yield importlib.import_module("mesh_refinement")
        for name in MODULES:
            sys.modules.pop(name, None)


@pytest.fixture(scope="module")
def course(script: ModuleType) -> Any:  # a `Comparison`, of a module that is imported at run time
    """The Half Cuban Eight on all meshes."""
    inputs = script.load_inputs(TRACK)
    return script.compared("half_cuban_eight", inputs.race, inputs.settings, script.Stage.POINT_MASS)


def table(text: str) -> list[dict[str, str]]:
    """The first table in Markdown."""
    lines = [line for line in text.splitlines() if line.startswith("|")]
    cells = [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]
    return [dict(zip(cells[0], row, strict=True)) for row in cells[2:]]


def documented() -> list[dict[str, str]]:
    """The table in the documentation."""
    text = (ROOT / "docs" / "evidence.md").read_text(encoding="utf-8")
    (written,) = re.findall(r"<!-- meshes -->\n((?:\|.*\n)+)", text)
    return table(written)


def compared_to(course: Any, answer_drift: float) -> Any:
    """The same course with another drift of the procedure's answer."""
    answer = course.answer
    evidence = dataclasses.replace(answer.evidence, drift=np.full(answer.problem.intervals, answer_drift))
    return dataclasses.replace(course, refined=(*course.refined[:-1], dataclasses.replace(answer, evidence=evidence)))


def test_the_answer_is_the_mesh_of_the_procedure(course: Any) -> None:
    assert course.answer.race_time == course.result.trajectory.race_time
    assert course.answer.drift == course.result.mesh.drift.max()
    assert course.answer.defect == course.result.mesh.defect.max()
    assert course.answer.cumulated == pytest.approx(course.result.timings.solve)


def test_uniform_meshes_have_equal_intervals_of_the_length_asked_for(course: Any) -> None:
    nodes = [one.nodes for one in course.uniform]
    assert nodes == sorted(set(nodes))
    for one in course.uniform:
        for phase, duration in zip(one.problem.phases, one.iterate.durations, strict=True):
            assert set(phase.fractions) == {1.0 / len(phase.fractions)}
            length = duration / len(phase.fractions)
            # a whole number of them, and the phase was a little longer or shorter before
            assert length == pytest.approx(one.spacing, rel=0.02 + 0.6 * one.spacing / duration)


def test_meshes_converge_to_the_race_time_compared_with(course: Any) -> None:
    assert course.halved[-1].nodes - 1 == 4 * (course.answer.nodes - 1)
    assert course.error(course.halved[-1]) == 0.0
    assert course.uncertainty < course.error(course.answer) < course.error(course.refined[0])
    assert course.error(course.uniform[-1]) < 0.01 * course.error(course.uniform[0])


def test_an_optimum_carried_to_its_own_mesh_is_itself(course: Any) -> None:
    carried = sys.modules["mesh_comparison"].carried
    for one in (course.answer, course.uniform[0]):
        again = carried(one, one.problem.mesh)
        np.testing.assert_allclose(again.state, one.iterate.state, atol=1e-9)
        np.testing.assert_allclose(again.control, one.iterate.control, atol=1e-9)


def test_carried_controls_keep_their_integrals(course: Any) -> None:
    carried = sys.modules["mesh_comparison"].carried
    fine, coarse = course.answer, course.uniform[0]
    control = carried(fine, coarse.problem.mesh).control
    for index in range(len(fine.problem.phases)):
        sums = []
        for problem, values in ((fine.problem, fine.iterate.control), (coarse.problem, control)):
            first, last = problem.first_node[index : index + 2]
            sums.append(values[:, first:last] @ np.asarray(problem.phases[index].fractions))
        np.testing.assert_allclose(sums[0], sums[1], rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("measure", ["race time", "Hamiltonian", "both", "replay"])
def test_a_row_names_the_smallest_uniform_mesh_that_is_as_accurate(
    course: Any, script: ModuleType, capsys: pytest.CaptureFixture[str], measure: str
) -> None:
    script.printed(script.comparison_table([course]), markdown=True)
    (row,) = [row for row in table(capsys.readouterr().out) if row["as accurate in"] == measure]
    (named,) = [one for one in course.uniform if str(one.nodes) == row["uniform nodes"]]
    for one in course.uniform:
        good = {
            "race time": course.error(one) <= course.error(course.answer),
            "Hamiltonian": one.drift <= course.answer.drift,
            "replay": one.defect <= course.answer.defect,
        }
        good["both"] = good["race time"] and good["Hamiltonian"]
        assert one.nodes >= named.nodes if good[measure] else one is not named
    assert float(row["share of nodes"]) == pytest.approx(course.answer.nodes / named.nodes, abs=0.005)
    assert float(row["its drift"]) == pytest.approx(named.drift, abs=5e-5)
    assert float(row["its error ms"]) == pytest.approx(1e3 * course.error(named), abs=5e-3)


def test_what_no_uniform_mesh_reaches_is_a_bound(
    course: Any, script: ModuleType, capsys: pytest.CaptureFixture[str]
) -> None:
    script.printed(script.comparison_table([compared_to(course, 0.0)]), markdown=True)
    row = table(capsys.readouterr().out)[1]
    assert row["uniform nodes"] == f"> {course.uniform[-1].nodes}"
    assert row["share of nodes"] == f"< {course.answer.nodes / course.uniform[-1].nodes:.2f}"


def test_the_exit_code_is_the_verdict(
    course: Any, script: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    better = dataclasses.replace(compared_to(course, 0.0), reference=course.answer.race_time)
    for flown, code in ((course, 1), (better, 0)):
        monkeypatch.setattr(script, "compared", lambda *_, flown=flown: flown)
        assert script.main([str(TRACK)]) == code
        assert f"in both: {1 - code} of 1 courses" in capsys.readouterr().out
    assert script.main([str(TRACK), str(ROOT / "none.yaml")]) == 1
    assert "none" in capsys.readouterr().err


@pytest.mark.slow
def test_the_figure_is_drawn(course: Any, script: ModuleType, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    importlib.import_module("mesh_refinement_figure").draw([course], tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000


def test_the_docs_show_a_table_of_the_script_with_the_verdict_it_claims(course: Any, script: ModuleType) -> None:
    rows = documented()
    assert tuple(rows[0]) == script.comparison_table([course])[0]
    good = dict.fromkeys(script.MEASURES, 0)
    nodes = 0
    for row in rows:
        nodes = int(row["nodes"] or nodes)
        share = nodes / int(row["uniform nodes"].removeprefix("> "))
        assert float(row["share of nodes"].removeprefix("< ")) == pytest.approx(share, abs=0.006)
        good[row["as accurate in"]] += share <= script.SHARE
    assert [row["course"] for row in rows if row["course"]] == list(script.NAMES)
    assert all(good[measure] >= script.ENOUGH for measure in script.DECISIVE)


@pytest.mark.slow
def test_the_docs_show_what_the_script_finds(script: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    name = script.NAMES[-1]
    assert script.main([str(ROOT / "tracks" / f"{name}.yaml"), "--markdown"]) == 0
    printed, written = table(capsys.readouterr().out), documented()
    place = [row["course"] for row in written].index(name)
    for ours, theirs in zip(printed, written[place : place + len(script.MEASURES)], strict=True):
        assert ours["as accurate in"] == theirs["as accurate in"]
        assert ours["nodes"] == theirs["nodes"]
        shares = [float(row["share of nodes"].removeprefix("< ")) for row in (ours, theirs)]
        assert shares[0] == pytest.approx(shares[1], rel=0.1)  # the next mesh between is 9 % finer
        if ours["error ms"]:
            assert float(ours["error ms"]) == pytest.approx(float(theirs["error ms"]), abs=0.05)
            assert float(ours["drift"]) == pytest.approx(float(theirs["drift"]), rel=0.05)
