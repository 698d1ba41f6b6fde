"""Write air races as nonlinear programs for other solvers: functions of CasADi with start, bounds and optimum as JSON.

    python scripts/race_programs.py FOLDER [COURSE ...] [--threads N]

Every course (by default all that are shipped) is flown by the point mass until its optimum is certified on a second
mesh. FOLDER/COURSE.casadi is its discretised problem as one function `(x, p) -> (f, g)`, FOLDER/COURSE.json what a
solver needs besides, and the certified solution; docs/race_programs.md describes both. Residuals are measured with the
function as it was written. Exit code 1 if a course has no certified optimum.
"""

import argparse
import json
import sys
from importlib import metadata
from pathlib import Path

import casadi as ca
import numpy as np

import airrace
from airrace.optimal_control.casadi_nlp import to_casadi
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import guess
from airrace.procedure.stage_problem import formulate, mesh_of
from airrace.runs.stage_view import StageView

ROOT = Path(__file__).resolve().parent.parent
FORMAT = "airrace/program/1"
INFINITE = 1e20
"""What stands for no bound, as JSON has no infinity."""
RESIDUALS = ("primal", "dual", "complementarity")


def write_program(stage: StageView, course: str, folder: Path) -> tuple[Path, Path]:
    """Write the function and the document of a point mass's optimum; return their paths."""
    result, race = stage.result, stage.inputs.race
    nlp = stage.to_casadi()
    stage_problem = formulate(result.stage, race, stage.inputs.settings, result.trajectory, result.pylon_conditions)
    mesh = mesh_of(result.trajectory)
    start = to_casadi(stage_problem.problem(mesh), guess(stage_problem.plan, mesh)).x0
    symbols, outputs = [nlp.nlp["x"], nlp.nlp["p"]], [nlp.nlp["f"], nlp.nlp["g"]]
    function_path, document_path = folder / f"{course}.casadi", folder / f"{course}.json"
    ca.Function("race", symbols, outputs, ["x", "p"], ["f", "g"]).save(str(function_path))
    assert result.certificate is not None  # it is certified
    program = {
        "format": FORMAT,
        "course": course,
        "stage": stage.name,
        "aircraft": race.aircraft.name,
        "casadi": ca.__version__,
        "airrace": metadata.version("airrace"),
        "race_time_s": stage.race_time,
        "certified": stage.certified,
        "certificate": {item.name: item.value for item in result.certificate.items},
        "p": nlp.p.tolist(),
        "lbx": bounds(nlp.lbx),
        "ubx": bounds(nlp.ubx),
        "lbg": bounds(nlp.lbg),
        "ubg": bounds(nlp.ubg),
        "start": np.clip(start, nlp.lbx, nlp.ubx).tolist(),
        "x": nlp.x0.tolist(),
        "lam_g": result.constraint_multipliers.tolist(),
        "lam_x": result.bound_multipliers.tolist(),
        "scale": nlp.scale.tolist(),
        "x_names": list(nlp.x_names),
        "g_names": list(nlp.g_names),
    }
    function = ca.Function.load(str(function_path))
    f, _ = function(nlp.x0, nlp.p)
    program |= {"objective": float(f), "residuals": residuals(function, program)}
    document_path.write_text(json.dumps(program) + "\n", encoding="utf-8")
    return function_path, document_path


def bounds(values: Array) -> list[float]:
    """Bounds that JSON can hold."""
    return np.clip(values, -INFINITE, INFINITE).tolist()


def residuals(function: ca.Function, program: dict[str, object]) -> dict[str, float]:
    """The largest violations of the optimality conditions at the stored optimum, in scaled units.

    Primal: of a bound of x or g. Dual: of the gradient of `f + lam_g g + lam_x x`. Complementarity: a multiplier times
    the distance from the bound on which it presses, positive ones upwards; alone where that is more than 1.
    """
    x, p, lam_g, lam_x = (np.array(program[key]) for key in ("x", "p", "lam_g", "lam_x"))
    w, parameters = ca.MX.sym("x", len(x)), ca.MX.sym("p", len(p))
    f, g = function(w, parameters)
    lagrangian = f + ca.dot(ca.DM(lam_g), g)
    measured = ca.Function("measured", [w, parameters], [g, ca.gradient(lagrangian, w)])
    values, gradient = (np.asarray(output).ravel() for output in measured(x, p))
    primal, slackness = 0.0, 0.0
    for value, multiplier, lower, upper in (
        (x, lam_x, program["lbx"], program["ubx"]),
        (values, lam_g, program["lbg"], program["ubg"]),
    ):
        below, above = value - np.array(lower), np.array(upper) - value
        primal = max(primal, float(-np.minimum(below, above).min()))
        slack = np.where(np.array(lower) == np.array(upper), 0.0, np.where(multiplier > 0.0, above, below))
        slackness = max(slackness, float((np.abs(multiplier) * np.minimum(np.abs(slack), 1.0)).max()))
    dual = float(np.abs(gradient + lam_x).max())
    return dict(zip(RESIDUALS, (max(primal, 0.0), dual, slackness), strict=True))


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path, metavar="FOLDER")
    parser.add_argument("courses", nargs="*", metavar="COURSE")
    parser.add_argument("--threads", type=int)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    courses = arguments.courses or sorted(path.stem for path in (ROOT / "tracks").glob("*.yaml"))
    columns = ("unknowns", "constraints", "race time s", "objective s", *RESIDUALS, "MB")
    print(f"| course | {' | '.join(columns)} |\n|{' --- |' * (len(columns) + 1)}")
    missing = 0
    for course in courses:
        run = airrace.optimize(course, until="point-mass", mesh_check="all", threads=arguments.threads)
        if not run.certified:
            print(f"| `{course}` | no certified optimum: {run.message} |", flush=True)
            missing += 1
            continue
        paths = write_program(run["point-mass"], course, arguments.folder)
        program = json.loads(paths[1].read_text(encoding="utf-8"))
        sizes = (
            f"{len(program['x'])} | {len(program['lbg'])} | {program['race_time_s']:.3f} | {program['objective']:.6f}"
        )
        errors = " | ".join(f"{program['residuals'][name]:.1e}" for name in RESIDUALS)
        megabytes = sum(path.stat().st_size for path in paths) / 1e6
        print(f"| `{course}` | {sizes} | {errors} | {megabytes:.1f} |", flush=True)
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
