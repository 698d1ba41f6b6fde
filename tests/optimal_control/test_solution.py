"""Solutions by name: what multipliers and costates mean, what is claimed, and what files and tables say."""

import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from own_problems import carried_mass, two_seconds

import airrace.optimal_control as engine
from airrace.errors import UsageError
from airrace.optimal_control import (
    RK4,
    Accuracy,
    Interval,
    Observation,
    Phase,
    Problem,
    Quantity,
    Solution,
    at,
    define_problem,
    solve,
    uniform,
)


def with_a_condition_more(problem: Problem) -> Problem:
    """The same with a condition on what is observed of its end."""
    x, b = ca.SX.sym("x", 3), ca.SX.sym("b", 0)
    seen = Observation("seen", (Quantity("sum", "m"),), (), ca.Function("seen", [x, b], [x[0] + x[1]]))
    end = replace(problem.phases[-1].end, bounds={"sum": Interval(0.0, 9.0)}, observation=seen)
    return replace(problem, phases=(replace(problem.phases[0], end=end),))


def test_multipliers_are_minus_what_the_objective_changes_by_per_unit() -> None:
    change = 1e-3
    base = solve(carried_mass(speed_max=1.3), tolerance=1e-9)
    faster = solve(carried_mass(speed_max=1.3 + change), tolerance=1e-9)
    farther = solve(carried_mass(distance=1.0 + change, speed_max=1.3), tolerance=1e-9)
    later = solve(carried_mass(seconds=1.0 + change, speed_max=1.3), tolerance=1e-9)
    limit = base.multiplier("v")[1:-1].sum()
    assert limit > 0.1
    assert (faster.objective - base.objective) / change == pytest.approx(-limit, rel=0.01)
    assert (farther.objective - base.objective) / change == pytest.approx(-base.multiplier("x")[-1], rel=0.01)
    assert (later.objective - base.objective) / change == pytest.approx(-base.multiplier("duration")[0], rel=0.01)


def test_costates_say_what_a_shifted_state_costs_and_the_hamiltonian_is_constant() -> None:
    solution = solve(carried_mass(), tolerance=1e-10)
    # x(0) = d shortens the way: the cost is 12 (1 - d)^2
    assert solution.costate("x") == pytest.approx(-24.0, rel=2e-3)
    assert solution.multiplier("x")[0] == pytest.approx(24.0, rel=2e-3)
    assert solution.hamiltonian == pytest.approx(-solution.multiplier("duration")[0], rel=2e-2)


def test_a_minimum_of_one_mesh_is_called_so_until_a_second_one_agrees() -> None:
    once, twice = solve(carried_mass()), solve(carried_mass(), second_mesh=True, accuracy=Accuracy(change=1e-2))
    assert not once.certified
    assert once.verdict == "a local minimum of this mesh of 40 intervals; no second mesh confirms it"
    assert twice.certified
    assert "of this mesh" not in twice.verdict
    assert "the objectives on 80 intervals and on at most half as many differ by" in twice.verdict
    strict = solve(carried_mass(), second_mesh=True, accuracy=Accuracy(change=1e-6))
    assert not strict.certified
    assert "of this mesh of 80 intervals; not certified: objective_change" in strict.verdict


def test_refinement_makes_the_answer_as_accurate_as_asked() -> None:
    coarse = carried_mass(intervals=4)
    solution = solve(coarse, refine=True, accuracy=Accuracy(change=1e-4))
    assert solution.certified, solution.verdict
    assert solution.objective == pytest.approx(12.0, rel=1e-4)
    assert solution.meshes[0].intervals == 4
    assert solution.meshes[-1].intervals == len(solution.control("f"))
    assert solution.meshes[-1].objective == solution.objective


def test_without_an_optimum_the_answer_says_so_and_nothing_is_refined() -> None:
    solution = solve(carried_mass(), iterations_max=1, refine=True)
    assert not solution.success
    assert solution.verdict.startswith("no optimum: ")
    assert solution.certificate is None
    assert len(solution.meshes) == 1


def test_without_a_feasible_point_the_worst_constraint_is_named() -> None:
    late = carried_mass(speed_max=0.5)
    solution = solve(late)
    assert not solution.success
    assert "most violated: carry: " in solution.verdict


def test_a_finer_mesh_without_an_optimum_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    from airrace.optimal_control import solve_problem

    answer = solve_problem.solve_program
    monkeypatch.setattr(
        solve_problem,
        "solve_program",
        lambda problem, *arguments, options, **more: answer(
            problem,
            *arguments,
            options=options if problem.intervals == 40 else engine.SolverOptions(iterations_max=0),
            **more,
        ),
    )
    solution = solve(carried_mass(), second_mesh=True)
    assert solution.success
    assert "of this mesh of 40 intervals; not certified: no optimum was found on 80 intervals" in solution.verdict


def test_schemes_and_solvers_are_arguments() -> None:
    solution = solve(carried_mass(), scheme=RK4, solver="ipopt", tolerance=1e-8)
    assert (solution.problem.scheme, solution.solver) == (RK4, "ipopt")
    assert solution.kkt.largest <= 1e-8
    with pytest.raises(ValueError, match="no solver 'simplex'; there are interior-point, ipopt"):
        solve(carried_mass(), solver="simplex")


def test_unknown_names_are_refused_with_those_that_there_are() -> None:
    solution = solve(carried_mass())
    for ask in (solution.state, solution.costate):
        with pytest.raises(KeyError, match="there are x, v, integral_cost"):
            ask("f")
    with pytest.raises(KeyError, match="there are f"):
        solution.control("x")
    with pytest.raises(KeyError, match="there are none"):
        solution.output("x")
    with pytest.raises(KeyError, match="could be limited"):
        solution.multiplier("q")


def test_a_file_gives_the_same_solution_back(tmp_path: Path) -> None:
    solution = solve(carried_mass(), second_mesh=True)
    solution.save(tmp_path / "carried.npz")
    loaded = Solution.load(tmp_path / "carried.npz", carried_mass(intervals=7))
    assert str(loaded) == str(solution)
    assert loaded.problem.intervals == 80
    for name in ("x", "v"):
        np.testing.assert_array_equal(loaded.state(name), solution.state(name))
        np.testing.assert_array_equal(loaded.costate(name), solution.costate(name))
    np.testing.assert_array_equal(loaded.hamiltonian, solution.hamiltonian)
    assert loaded.certificate is not None
    assert solution.certificate is not None
    assert loaded.certificate.items == solution.certificate.items
    assert str(loaded.second_order) == str(solution.second_order)


def test_files_of_other_problems_and_other_files_are_refused(tmp_path: Path) -> None:
    solve(carried_mass()).save(tmp_path / "carried.npz")
    with pytest.raises(UsageError, match="system carried mass instead of two seconds"):
        Solution.load(tmp_path / "carried.npz", two_seconds())
    with pytest.raises(UsageError, match=r"multipliers of .* constraints"):  # a limit more
        Solution.load(tmp_path / "carried.npz", with_a_condition_more(carried_mass()))
    (tmp_path / "text.npz").write_text("no archive")
    for name in ("text.npz", "absent.npz"):
        with pytest.raises(UsageError, match=name):
            Solution.load(tmp_path / name, carried_mass())


def test_a_dataset_has_everything_by_name_with_units_and_signs() -> None:
    pytest.importorskip("xarray")
    solution = solve(two_seconds())
    data = solution.to_xarray()
    np.testing.assert_array_equal(data["x"].values, solution.state("x"))
    np.testing.assert_array_equal(data["costate_x"].values, solution.costate("x"))
    np.testing.assert_array_equal(data["multiplier_u"].values, solution.multiplier("u"))
    np.testing.assert_array_equal(data["hamiltonian"].values, solution.hamiltonian)
    assert data["duration"].values.tolist() == [1.0, 1.0]
    assert data["phase"].values.tolist() == ["first", "first", "second", "second"]
    assert data["x"].attrs["units"] == "m"
    assert data["costate_x"].attrs["units"] == "1/(m)"
    assert "grows" in data["costate_x"].attrs["sign"]
    assert data.attrs["verdict"] == solution.verdict
    assert data.attrs["certified"] == solution.certified


def test_the_certificate_says_where_on_the_flight_a_boundary_is() -> None:
    certificate = solve(two_seconds()).certificate
    assert certificate is not None
    places = {item.name: item.where for item in certificate.items}
    assert places["gate_m"].split(", ")[0] in ("the start", "the end of first", "the end of second")


def test_a_dataset_takes_states_with_the_names_of_its_own() -> None:
    pytest.importorskip("xarray")
    problem = define_problem(
        "clockwork",
        lambda x, u: {"time": 1.0},
        states=[Quantity("time", "s")],
        start=at(time=0.0),
        phases=[Phase("tick", uniform(2), Interval(0.1, 5.0), at(time=2.0))],
    )
    data = solve(problem).to_xarray()
    np.testing.assert_allclose(data["own_time"].values, data["time"].values, atol=1e-8)


def test_a_data_frame_has_a_row_per_node_and_its_units() -> None:
    pytest.importorskip("pandas")
    solution = solve(two_seconds())
    frame = solution.to_dataframe()
    assert len(frame) == 5
    assert frame["time"].tolist() == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert frame["phase"].tolist() == ["first", "first", "second", "second", "second"]
    assert frame["costate_x"].tolist()[1:] == solution.costate("x").tolist()
    assert frame.attrs["units"]["u"] == solution.units["u"] == "m/s"
    assert frame.attrs["verdict"] == solution.verdict


def test_a_figure_has_a_panel_per_state_and_control() -> None:
    pytest.importorskip("matplotlib")
    figure = solve(carried_mass()).plot()
    assert [axes.get_title() for axes in figure.axes] == ["x [m]", "v [m/s]", "integral of the cost", "f [m/s2]"]


def test_every_public_name_is_found_and_none_is_that_of_a_module() -> None:
    for name in dir(engine):
        assert getattr(engine, name) is not None
        assert find_spec(f"airrace.optimal_control.{name}") is None
    with pytest.raises(AttributeError, match="no_such_name"):
        engine.no_such_name  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue, reportUnknownMemberType]


def test_importing_the_engine_loads_nothing_heavy() -> None:
    program = "import airrace.optimal_control, sys; print(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert {"numpy", "casadi", "scipy"}.isdisjoint(ran.stdout.split())
