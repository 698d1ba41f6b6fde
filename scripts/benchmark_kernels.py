"""Measure the kernels: how long they take to compile and to evaluate, for several intervals at once and for one.

    python scripts/benchmark_kernels.py [--models NAME ...] [--airs still wind] [--graphs] [--calls 2000] [--rounds 9]

Four kinds of a step stand side by side: composed of its stages' derivatives for as many intervals at once as the
processor has lanes (what `build_kernels` compiles), the same evaluated by the machine for all models, the same compiled
for one interval at a time, and casadi's graph of the whole step with its Jacobian and Hessian, compiled with `--graphs`
(minutes) and evaluated by casadi's virtual machine else. The model's rates, as the replay asks for them, are evaluated
by the compiled library, by casadi's virtual machine on arrays that stay where they are, and by calling casadi from
Python. Times are processor time per interval or point, the best of several rounds; all kinds are measured in turn, in
one run.
"""

import argparse
import ctypes
import os
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import casadi as ca
import numpy as np
from airrace.optimal_control.compiled_rates import compiled_rows, interpreted
from airrace.optimal_control.kernel_library import compile_library, generated_source
from airrace.optimal_control.lanes import SINGLE, InstructionSet, instruction_set
from airrace.optimal_control.machine_kernels import machine_kernels

from airrace.documents.inputs import load_inputs
from airrace.dynamics.flight_model import FlightModel
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.environment.air import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.kernels import Kernel, Kernels, build_kernels, cached_rows, symbolic_kernels
from airrace.optimal_control.mapping import Callee, Part
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5

ROOT = Path(__file__).resolve().parent.parent
WIND = Air(
    wind=StaticWind(1.0, 5.0, Profile.POWER),
    thermals=(Thermal(0.0, 0.0, 2.0, 1000.0), Thermal(50.0, 80.0, 2.0, 1000.0)),
)
AIRS = {"still": Air(), "wind": WIND}
BUILDERS = {
    "point-mass": build_point_mass,
    "transfer-function": build_transfer_functions,
    "state-space-inversion": build_state_space_inversion,
    "state-space": build_state_space,
    "six-dof": build_six_dof,
}
CENTRES = {"z": -200.0, "V_K": 80.0, "q0": 1.0, "delta_T": 0.7}
SPREADS = {"x": 100.0, "y": 100.0, "z": 10.0, "V_K": 5.0, "delta_T": 0.05}
Timed = Callable[[], float]
FUNCTIONS = ("step", "step_jacobian", "step_hessian")


def arguments(function: ca.Function, model: FlightModel, count: int) -> list[np.ndarray]:
    """Random points of flight, one per column, and multipliers."""
    random = np.random.default_rng(0)
    states, controls = model.system.states, model.system.controls
    x = [CENTRES.get(one.name, 0.0) + SPREADS.get(one.name, 0.1) * random.normal(size=count) for one in states]
    y = np.vstack([*x, random.normal(size=(len(controls), count)), random.uniform(3.0, 9.0, count)])
    own, shared = random.uniform(0.01, 0.03, (1, count)), np.tile(model.parameter_values[:, None], count)
    return [y, own, shared, random.normal(size=(len(states), count))][: function.n_in()]


def evaluation(function: ca.Function, of_one: ca.Function, lanes: int, model: FlightModel, count: int) -> Timed:
    """What evaluates a function of so many lanes at many points and tells the seconds of one of them."""
    mapped = function.map(count // lanes)
    given = [np.ascontiguousarray(one.T).ravel() for one in arguments(of_one, model, count)]
    if lanes > 1:
        given[2] = given[2][: len(given[2]) // lanes]
    results = [np.zeros(mapped.nnz_out(place)) for place in range(mapped.n_out())]
    buffer, evaluate = mapped.buffer()
    for place, array in enumerate(given):
        buffer.set_arg(place, array.data)
    for place, array in enumerate(results):
        buffer.set_res(place, array.data)

    kept = buffer, given  # nobody else holds what `evaluate` works on

    def seconds() -> float:
        started = time.process_time()
        evaluate()
        taken = time.process_time() - started
        if not all(np.isfinite(one).all() for one in results) or kept[0].ret():
            raise SystemExit(f"{function.name()} is not finite at the points of the benchmark")
        return taken / count

    return seconds


def machine_evaluation(step: Callee, part: Part, of_one: ca.Function, model: FlightModel, count: int) -> Timed:
    """What evaluates a function of the machine at many points and tells the seconds of one of them."""
    given = [np.ascontiguousarray(one.T).ravel() for one in arguments(of_one, model, count)]
    given[2] = given[2][: len(given[2]) // step.lanes]
    call, _ = step.bound(part, count // step.lanes, 1, given)
    return timed(call, count)


def timed(call: Callable[[], object], count: int) -> Timed:
    """What calls and tells the processor's seconds of one of so many points."""

    def seconds() -> float:
        started = time.process_time()
        call()
        return (time.process_time() - started) / count

    return seconds


def best(kinds: Sequence[Timed], rounds: int) -> np.ndarray:
    """Microseconds of each kind, measured in turn."""
    return np.array([[seconds() for seconds in kinds] for _ in range(rounds)]).min(axis=0) * 1e6


def compiled_kernels(model: FlightModel, instructions: InstructionSet, kind: str) -> Kernels:
    """Kernels of a model; says what their compilation takes."""
    started, before = time.perf_counter(), os.times()
    kernels = build_kernels(model.system, DORMAND_PRINCE_5, compiled=True, instructions=instructions)
    after = os.times()
    spent = after.children_user + after.children_system - before.children_user - before.children_system
    print(f"  {kind:<9} {time.perf_counter() - started:8.2f} s to compile, {spent:.2f} s of processor time", flush=True)
    return kernels


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
    widest = instruction_set()
    lanes = compiled_kernels(model, widest, f"{widest.lanes} lanes").step
    single = compiled_kernels(model, SINGLE, "single").step
    whole = graphs(model, folder, compiled=compiled)
    started = time.process_time()
    machine = machine_kernels(model.system, DORMAND_PRINCE_5)
    if machine is None:
        raise SystemExit("there is no machine: the processor or the compiler has no vectors")
    print(f"  machine   {time.process_time() - started:8.2f} s to write the tables", flush=True)
    count = calls // lanes.lanes * lanes.lanes
    print("  us per interval     lanes machine  single   graph  machine / lanes  single / lanes")
    for part, name, of in zip(Part, FUNCTIONS, (value, jacobian, hessian), strict=True):
        kinds = [
            evaluation(of(lanes.several or lanes), of(lanes), lanes.lanes, model, count),
            machine_evaluation(machine.step, part, of(lanes), model, count),
            evaluation(of(single), of(single), 1, model, count),
            evaluation(whole[name], whole[name], 1, model, count),
        ]
        mine, tables, one, graph = best(kinds, rounds)
        ratios = f"{tables / mine:17.2f}{one / mine:16.2f}"
        print(f"  {name:<17}{mine:8.2f}{tables:8.2f}{one:8.2f}{graph:8.2f}{ratios}", flush=True)
    measure_rates(model, count, rounds)


def measure_rates(model: FlightModel, count: int, rounds: int) -> None:
    """The model's rates at many points, as the replay calls them."""
    library, system = cached_rows(model.system, DORMAND_PRINCE_5), model.system
    if library is None:
        return
    y, p, n_x = arguments(system.rates, model, count)[0], model.parameter_values, len(system.states)
    x, u = np.ascontiguousarray(y[:n_x]), np.ascontiguousarray(y[n_x:-1])
    rows, machine = compiled_rows(ctypes.CDLL(str(library)), "rates", n_x, u, p), interpreted(system.rates, u, p)
    mapped, many = system.rates.map(count), np.tile(p[:, None], count)
    calls = (lambda: rows(x), lambda: machine(x), lambda: np.asarray(mapped(x, u, many)))
    lanes, buffered, python = best([timed(call, count) for call in calls], rounds)
    print(f"  rates            {lanes:8.2f} compiled{buffered:8.2f} virtual machine{python:8.2f} called from Python")


def value(kernel: Kernel) -> ca.Function:
    """Of a kernel, the function itself."""
    return kernel.value


def jacobian(kernel: Kernel) -> ca.Function:
    """Of a kernel, its Jacobian."""
    return kernel.jacobian


def hessian(kernel: Kernel) -> ca.Function:
    """Of a kernel, its Hessian."""
    return kernel.hessian


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
