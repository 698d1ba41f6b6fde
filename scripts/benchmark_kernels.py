"""Measure the step kernels: how long they take to compile and to evaluate, against the graphs of whole steps.

    python scripts/benchmark_kernels.py [--models NAME ...] [--airs still wind] [--graphs] [--calls 2000] [--rounds 9]

Composed derivatives (what `build_kernels` compiles) stand beside casadi's graph of the whole step with its Jacobian and
Hessian, compiled with `--graphs` (minutes) and evaluated by casadi's virtual machine else. Times are the best of
several rounds; both kinds are measured in turn, in one run.
"""

import argparse
import os
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np

from airrace.documents.inputs import load_inputs
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.kernel_library import compile_library, generated_source
from airrace.optimal_control.kernels import build_kernels, symbolic_kernels
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5

ROOT = Path(__file__).resolve().parent.parent
WIND = Air(
    wind=StaticWind(1.0, 5.0, Profile.POWER),
    thermals=(Thermal(0.0, 0.0, 2.0, 1000.0), Thermal(50.0, 80.0, 2.0, 1000.0)),
)
AIRS = {"still": Air(), "wind": WIND}
BUILDERS = {"point-mass": build_point_mass, "six-dof": build_six_dof}
CENTRES = {"z": -200.0, "V_K": 80.0, "q0": 1.0, "delta_T": 0.7}
SPREADS = {"x": 100.0, "y": 100.0, "z": 10.0, "V_K": 5.0, "delta_T": 0.05}
FUNCTIONS = ("step", "step_jacobian", "step_hessian")


def arguments(function: ca.Function, model: FlightModel, count: int) -> list[np.ndarray]:
    """Random points of flight, one per column, and multipliers."""
    random = np.random.default_rng(0)
    states, controls = model.system.states, model.system.controls
    x = [CENTRES.get(one.name, 0.0) + SPREADS.get(one.name, 0.1) * random.normal(size=count) for one in states]
    y = np.vstack([*x, random.normal(size=(len(controls), count)), random.uniform(3.0, 9.0, count)])
    own, shared = random.uniform(0.01, 0.03, (1, count)), np.tile(model.parameter_values[:, None], count)
    return [y, own, shared, random.normal(size=(len(states), count))][: function.n_in()]


def evaluation(function: ca.Function, model: FlightModel, count: int) -> Callable[[], float]:
    """What evaluates the function at many points and tells the seconds of one call."""
    mapped = function.map(count)
    given = [np.ascontiguousarray(one.T).ravel() for one in arguments(function, model, count)]
    results = [np.zeros(mapped.nnz_out(place)) for place in range(mapped.n_out())]
    buffer, evaluate = mapped.buffer()
    for place, array in enumerate(given):
        buffer.set_arg(place, array.data)
    for place, array in enumerate(results):
        buffer.set_res(place, array.data)

    kept = buffer, given  # nobody else holds what `evaluate` works on

    def seconds() -> float:
        started = time.perf_counter()
        evaluate()
        taken = time.perf_counter() - started
        if not all(np.isfinite(one).all() for one in results) or kept[0].ret():
            raise SystemExit(f"{function.name()} is not finite at the points of the benchmark")
        return taken / count

    return seconds


def graphs(model: FlightModel, folder: Path, *, compiled: bool) -> dict[str, ca.Function]:
    """Whole steps as casadi's graphs; says what their compilation takes."""
    started = time.perf_counter()
    functions = symbolic_kernels(model.system, DORMAND_PRINCE_5)
    if compiled:
        library = folder / "graphs.so"
        compile_library([generated_source(function) for function in functions.values()], library)
        functions = {name: ca.external(name, str(library)) for name in FUNCTIONS}
    print(f"  graphs    {time.perf_counter() - started:8.2f} s to {'compile' if compiled else 'write'}", flush=True)
    return functions


def measure(model: FlightModel, folder: Path, *, compiled: bool, calls: int, rounds: int) -> None:
    """One model, from an empty cache."""
    print(f"{model.system.name}: {len(model.system.states)} states, {len(model.system.controls)} controls", flush=True)
    os.environ["AIRRACE_CACHE_DIR"] = str(folder)
    started = time.perf_counter()
    step = build_kernels(model.system, DORMAND_PRINCE_5, compiled=True).step
    print(f"  composed  {time.perf_counter() - started:8.2f} s to compile", flush=True)
    whole = graphs(model, folder, compiled=compiled)
    for name, composed in zip(FUNCTIONS, (step.value, step.jacobian, step.hessian), strict=True):
        pair = [evaluation(composed, model, calls), evaluation(whole[name], model, calls)]
        times = np.array([[seconds() for seconds in pair] for _ in range(rounds)])
        mine, theirs = times.min(axis=0) * 1e6
        print(f"  {name:<14}{mine:8.2f} us composed{theirs:8.2f} us graph{mine / theirs:8.2f}", flush=True)


def main() -> None:
    """Run the benchmark and print its tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=list(BUILDERS), choices=list(BUILDERS))
    parser.add_argument("--airs", nargs="+", default=list(AIRS), choices=list(AIRS))
    parser.add_argument("--graphs", action="store_true", help="compile the graphs, too")
    parser.add_argument("--calls", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=9)
    chosen = parser.parse_args()
    race = load_inputs(ROOT / "tracks" / "rovinj_2014.yaml").race
    for name in chosen.models:
        for air in chosen.airs:
            model = BUILDERS[name](race.aircraft, race.course.rules, AIRS[air])
            with tempfile.TemporaryDirectory() as folder:
                measure(model, Path(folder), compiled=chosen.graphs, calls=chosen.calls, rounds=chosen.rounds)


if __name__ == "__main__":
    main()
