"""Hold the six-dof model against JSBSim: in states drawn by lot, and along optima.

    python scripts/crosscheck.py RUN.h5 [RUN.h5 ...]

Needs JSBSim, which the extra `test` installs.

First every shipped aircraft, and those of the runs, in 1,000 states: the specific force and the angular acceleration by
JSBSim and by our equations. JSBSim flies over a flat planet and over its own turning Earth; its density is ours, handed
over, or that of its own atmosphere. The latter goes by the geopotential height, so there are limits where our equations
are evaluated at that height; the difference at the same height is shown for the size of this effect.

Then the six-dof optimum of every run: JSBSim is put onto it at every full second and flies one second with its
controls, in its own atmosphere.

Exit code 1 if a limit is exceeded, 2 if a run cannot be flown.
"""

import argparse
import math
import sys
import tempfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jsbsim_aircraft.aircraft_xml import EARTH, FLAT, Planet
from jsbsim_aircraft.simulation import (
    at_geopotential_height,
    differences,
    fly_course,
    own_accelerations,
    random_states,
    simulate,
)

from airrace.errors import AirraceError, UsageError
from airrace.files.checkpoint import read_checkpoint
from airrace.files.inputs import load_inputs
from airrace.model.aircraft import Aircraft, inner_loop_parameters
from airrace.model.environment import Air, atmosphere_parameters
from airrace.procedure import stored_stages
from airrace.runs.run_state import RunState, run_of_checkpoint

ROOT = Path(__file__).resolve().parent.parent
STATES, SEED = 1000, 540
FORCE_LIMIT = 1e-3  # g
ANGULAR_LIMIT = 1e-3  # rad/s2
FASTEST = 300.0
"""The largest angular acceleration in the states up to which that limit holds, rad/s2; beyond, it grows with it. The
density of JSBSim's own atmosphere is a little different, and the Zlin, the lightest aircraft, rolls with 350 rad/s2."""
DISTANCE_LIMIT = 0.1  # m
ANGLE_LIMIT = math.radians(0.2)


@dataclass(frozen=True)
class Row:
    """One line of a table: what was compared, and whether its limits hold; None where it has none."""

    text: str
    holds: bool | None

    def __str__(self) -> str:
        verdict = {None: "", True: "yes", False: "NO"}[self.holds]
        return f"{self.text}  {verdict}".rstrip()


def in_states(aircraft: Aircraft) -> Iterable[Row]:
    """An aircraft in states drawn by lot, over both planets and in every air."""
    numbers, atmosphere = inner_loop_parameters(aircraft), atmosphere_parameters(Air())
    states = random_states(STATES, SEED)
    lowered = [at_geopotential_height(state, atmosphere) for state in states]
    fastest = max(float(np.abs(own_accelerations(state, numbers, atmosphere).angular).max()) for state in states)
    limit = ANGULAR_LIMIT * max(1.0, fastest / FASTEST)
    for planet in (FLAT, EARTH):
        for air, own_density, ours, limited in (
            ("handed over", False, states, True),
            ("at geopotential height", True, lowered, True),
            ("at the same height", True, states, False),
        ):
            with tempfile.TemporaryDirectory() as folder:
                flown = simulate(Path(folder), numbers, atmosphere, planet, own_density=own_density)
                force, angular = differences(flown, numbers, states, ours).worst
            text = f"{aircraft.name:<20}{planet.name:<8}{air:<24}{force:>12.1e}{angular:>12.1e}"
            yield Row(text, force <= FORCE_LIMIT and angular <= limit if limited else None)


def along_optimum(run: RunState, planet: Planet) -> Row:
    """The six-dof optimum of a run, second by second."""
    race = run.inputs.race
    if race.air.wind is not None or race.air.thermals:
        raise UsageError(f"{run.path}: a flight in wind; JSBSim flies in still air here")
    result = run.stage("six-dof").result
    with tempfile.TemporaryDirectory() as folder:
        flown = simulate(Path(folder), inner_loop_parameters(race.aircraft), atmosphere_parameters(race.air), planet)
        at = stored_stages.sampler(race, result)
        misses = fly_course(flown, result.trajectory, at, race.aircraft.propulsion.tau_T)
    farthest = max(misses, key=lambda miss: miss.distance)
    most_turned = max(misses, key=lambda miss: miss.angle)
    text = f"{run.path.stem:<20}{planet.name:<8}{len(misses):>8}"
    text += f"{farthest.distance:>12.4f}{farthest.start:>8.0f}"
    text += f"{math.degrees(most_turned.angle):>12.4f}{most_turned.start:>8.0f}"
    text += f"{np.median([miss.distance for miss in misses]):>12.4f}"
    return Row(text, farthest.distance <= DISTANCE_LIMIT and most_turned.angle <= ANGLE_LIMIT)


def shipped_aircraft() -> list[Aircraft]:
    """What `configs/` holds."""
    track = ROOT / "tracks/rovinj_2014.yaml"
    return [load_inputs(track, aircraft=path).race.aircraft for path in sorted((ROOT / "configs").glob("*.yaml"))]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("runs", nargs="*", type=Path, metavar="RUN.h5")
    paths: list[Path] = parser.parse_args().runs
    rows: list[Row] = []

    def tell(row: Row) -> None:
        rows.append(row)
        print(row, flush=True)

    try:
        runs = [run_of_checkpoint(read_checkpoint(path), path) for path in paths]
        print(f"{STATES} states: the worst of JSBSim minus ours; limits {FORCE_LIMIT} g and {ANGULAR_LIMIT} rad/s2")
        print(f"{'aircraft':<20}{'planet':<8}{'density':<24}{'g':>12}{'rad/s2':>12}  holds")
        for aircraft in dict.fromkeys([*shipped_aircraft(), *(run.inputs.race.aircraft for run in runs)]):
            for row in in_states(aircraft):
                tell(row)
        if runs:
            print(f"\none second by itself, from every full second: limits {DISTANCE_LIMIT} m and 0.2 deg")
            print(
                f"{'run':<20}{'planet':<8}{'pieces':>8}{'worst m':>12}{'from s':>8}"
                f"{'worst deg':>12}{'from s':>8}{'median m':>12}  holds"
            )
        for run in runs:
            for planet in (FLAT, EARTH):
                tell(along_optimum(run, planet))
    except AirraceError as error:
        print(error, file=sys.stderr)
        return 2
    return 0 if all(row.holds is not False for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
