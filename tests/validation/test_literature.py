"""Problems of the literature reach the optima that are published, and what is not reached is called so."""

import re
from dataclasses import replace
from pathlib import Path

import alp_rider
import least_fuel
import pytest
import solve_all
from benchmark import Benchmark

ROOT = Path(__file__).parents[2]
EVIDENCE = ROOT / "docs" / "evidence" / "literature.md"
PROBLEMS = solve_all.literature()


def named(benchmark: Benchmark) -> str:
    return benchmark.name


@pytest.mark.parametrize("benchmark", [b for b in PROBLEMS if b.quick], ids=named)
def test_published_optimum_is_reached(benchmark: Benchmark) -> None:
    solution = benchmark.solve()
    assert solution.success, solution.status
    assert benchmark.holds(solution), benchmark.error(solution)


def test_optimum_that_is_not_reached_is_called_no_optimum() -> None:
    (benchmark,) = alp_rider.benchmarks()
    solution = benchmark.solve()
    assert not solution.success
    assert not benchmark.holds(solution)
    assert solution.verdict.startswith("no optimum: ")


def test_other_value_than_the_published_one_does_not_hold(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (benchmark,) = least_fuel.benchmarks()
    wrong = replace(benchmark, published="0.77")
    monkeypatch.setattr(solve_all, "literature", lambda: (wrong,))
    assert solve_all.main([wrong.name]) == 1
    assert "NO: another optimum" in capsys.readouterr().out


def test_unknown_name_is_answered_with_those_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        solve_all.main(["brachistochron"])
    message = capsys.readouterr().err
    assert "no problem is called brachistochron" in message
    assert "brachistochrone, " in message


def test_table_of_the_documentation_has_every_problem_once_with_its_published_optimum() -> None:
    problems = (*PROBLEMS, *solve_all.known_answers())
    assert len({benchmark.name for benchmark in problems}) == len(problems) >= 40
    lines = re.findall(r"^\| (.*) \|$", EVIDENCE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    cells = [line.split(" | ") for line in lines[2:]]
    assert [(row[0], row[4]) for row in cells] == [(b.name, b.published) for b in problems]
    assert sum(row[-1] != "yes" for row in cells) <= 2


@pytest.mark.slow
def test_both_solvers_reach_the_same_optimum() -> None:
    for benchmark in PROBLEMS:
        if benchmark.quick:
            assert benchmark.holds(benchmark.solve("ipopt")), benchmark.name
