"""Reading of finished runs: the commands that show, compare or write them load nothing that only solving needs."""

import subprocess
import sys

READERS = {
    "airrace.runs.flight_sources",
    "airrace.cli.run_tables",
    "airrace.runs.json_objects",
    "airrace.cli.flight_tables",
    "airrace.pages.views.flight_figures",
}
"""What the bodies of the commands import: export, show, compare, report and plot."""
SOLVING = (
    "airrace.procedure.procedure",
    "airrace.procedure.stage_problem",
    "airrace.procedure.solver_session",
    "airrace.procedure.recomputation",
    "airrace.procedure.restart",
    "airrace.optimal_control.solvers.bounded_program",
    "airrace.optimal_control.kernels",
    "airrace.optimal_control.layout",
    "airrace.optimal_control.solvers.service",
    "airrace.optimal_control.solvers.solver",
    "airrace.optimal_control.solvers.ipopt",
    "airrace.flights.logs.log_flight",
    "airrace.flights.sensitivity.lagrangian",
    "multiprocessing",
    "scipy",
)
"""What only solving, measuring, pricing and the import of logs need."""


def loaded(program: str) -> set[str]:
    """Return the modules that a program of its own has loaded at its end."""
    program = f"{program}\nimport sys\nprint(*sys.modules)"
    ran = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return set(ran.stdout.split())


def test_readers_of_runs_load_nothing_that_only_solving_needs() -> None:
    modules = loaded(f"import {', '.join(READERS)}")
    assert modules >= READERS
    assert modules.isdisjoint(SOLVING), sorted(modules & set(SOLVING))


def test_what_solving_needs_is_named_as_it_is_loaded() -> None:
    program = (
        "import airrace.runs.execute, airrace.runs.stage_view, airrace.flights.logs.log_flight, scipy, multiprocessing"
    )
    program += "\nimport airrace.optimal_control.solvers.worker, airrace.flights.sensitivity.lagrangian"
    assert set(SOLVING) <= loaded(program)
