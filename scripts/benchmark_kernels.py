"""Measure the kernels: microseconds per interval of the native library's variants and of casadi, side by side.

    python scripts/benchmark_kernels.py [--models NAME ...] [--airs still wind] [--intervals 2000] [--rounds 9]

A step, its Jacobian and its Hessian are evaluated by every variant of the native library that the processor executes,
composed of the derivatives of its stages, and by casadi as graphs of the whole step. Rates, as the replay asks for
them, are evaluated by the variants and by casadi on arrays that stay where they are. Times are processor time per
interval or point, the best of several rounds; all are measured in turn, in one run.
"""

import argparse
import contextlib
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from airrace.errors import KernelError
from airrace.files.inputs.inputs import load_inputs
from airrace.model.dynamics.flight_model import FlightModel
from airrace.model.dynamics.point_mass import build_point_mass
from airrace.model.dynamics.six_dof import build_six_dof
from airrace.model.dynamics.state_space import build_state_space
from airrace.model.dynamics.state_space_inversion import build_state_space_inversion
from airrace.model.dynamics.transfer_functions import build_transfer_functions
from airrace.model.environment import Air, Profile, StaticWind, Thermal
from airrace.optimal_control.kernels import Callee, Part, casadi_kernels, native_kernels
from airrace.optimal_control.native.interpreter import Interpreter
from airrace.optimal_control.native.library import library_path, open_library
from airrace.optimal_control.runge_kutta import DORMAND_PRINCE_5
from airrace.optimal_control.system import at_points

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
Call = Callable[[], object]


def variants() -> dict[str, Interpreter]:
    """The variants that the processor executes, by name."""
    path = library_path()
    if path is None:
        raise SystemExit("the native library is missing")
    found: dict[str, Interpreter] = {}
    for name in ("baseline", "avx2", "avx512"):
        with contextlib.suppress(KernelError):
            found[name] = Interpreter(open_library(path, name))
    return found


def points(model: FlightModel, count: int) -> tuple[np.ndarray, np.ndarray]:
    """States and controls somewhere in flight, a point per column."""
    random = np.random.default_rng(0)
    states, controls = model.system.states, model.system.controls
    x = [CENTRES.get(one.name, 0.0) + SPREADS.get(one.name, 0.1) * random.normal(size=count) for one in states]
    return np.array(x), random.normal(size=(len(controls), count))


def evaluation(step: Callee, part: Part, model: FlightModel, count: int) -> Call:
    """The evaluation of a step's function at many intervals."""
    random, (x, u) = np.random.default_rng(1), points(model, count)
    y = np.vstack([x, u, random.uniform(3.0, 9.0, count)]).T
    given = [y, random.uniform(0.01, 0.03, count), np.tile(model.parameter_values, count // step.lanes)]
    if part is Part.HESSIAN:
        given.append(random.normal(size=(count, len(x))))
    arrays = [np.ascontiguousarray(one).ravel() for one in given]
    call, results = step.bind(part, count // step.lanes, 1, arrays)
    call()
    if not all(np.isfinite(one).all() for one in results):
        raise SystemExit("the step is not finite at the points of the benchmark")
    return lambda owned=(arrays, results): call()  # casadi does not keep them alive


def best(calls: Sequence[Call], count: int, rounds: int) -> list[float]:
    """Microseconds of each call per interval, measured in turn."""

    def seconds(call: Call) -> float:
        started = time.process_time()
        call()
        return time.process_time() - started

    times = np.array([[seconds(call) for call in calls] for _ in range(rounds)])
    return (times.min(axis=0) / count * 1e6).tolist()


def rates_calls(natives: Sequence[Interpreter], model: FlightModel, count: int) -> list[Call]:
    """The evaluation of a model's rates by all variants, then by casadi."""
    x, u = points(model, count)
    p = np.ascontiguousarray(model.parameter_values, dtype=np.float64)
    functions = [native.at_points(model.system.rates, u, p) for native in natives]
    functions.append(lambda x: at_points(model.system.rates, x, u, p))
    return [lambda at=at: at(x) for at in functions]


def measure(model: FlightModel, name: str, count: int, rounds: int) -> None:
    """Print the rows of one model."""
    natives, system = list(variants().values()), model.system
    kernels = [native_kernels(native, system, DORMAND_PRINCE_5) for native in natives]
    kernels.append(casadi_kernels(system, DORMAND_PRINCE_5))
    for part in Part:
        row = best([evaluation(one.step, part, model, count) for one in kernels], count, rounds)
        print(f"| `{name}` | {part.name.lower()} | " + " | ".join(f"{one:.2f}" for one in row) + " |", flush=True)
    row = best(rates_calls(natives, model, count), count, rounds)
    print(f"| `{name}` | rates | " + " | ".join(f"{one:.3f}" for one in row) + " |", flush=True)


def main() -> None:
    """Run the benchmark and print its table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--models", nargs="+", default=list(BUILDERS), choices=list(BUILDERS))
    parser.add_argument("--airs", nargs="+", default=list(AIRS), choices=list(AIRS))
    parser.add_argument("--intervals", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=9)
    chosen = parser.parse_args()
    race = load_inputs(ROOT / "tracks" / "rovinj_2014.yaml").race
    count = chosen.intervals // 8 * 8
    columns = [*variants(), "casadi"]
    print("| model | function | " + " | ".join(columns) + " |\n|" + "---|" * (len(columns) + 2))
    for name in chosen.models:
        for air in chosen.airs:
            model = BUILDERS[name](race.aircraft, race.course.rules, AIRS[air])
            measure(model, f"{name}, {air}", count, chosen.rounds)


if __name__ == "__main__":
    main()
