"""Better routes by prices alone: from the slowest flight that plans lead to, instead of the best one.

    python scripts/experiments/from_slowest.py COURSE...

Twelve plans of different turning radius are solved coarsely. The slowest flight is the best that a search by prices
knows at first; it is given the plans that a thorough search has, and none of the other flights. Race times are those of
coarse meshes.
"""

import argparse
from dataclasses import replace
from pathlib import Path

from airrace.files.inputs import load_inputs
from airrace.optimal_control.solvers.service import SolverPool, SolverService
from airrace.procedure.multistart.coarse_solution import finer_guess, solve_coarse, solve_finer
from airrace.procedure.multistart.lower_bound import PriceSearch
from airrace.procedure.multistart.plans import own_plans
from airrace.procedure.multistart.priced_window import RaceGuess
from airrace.procedure.multistart.search import QUICK, Radius, Search, planned_starts
from airrace.procedure.stage import Stage
from airrace.procedure.stage_problem import formulate

RADII = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3)
MANY = replace(QUICK, radii=tuple(Radius(factor, slower) for factor in RADII for slower in (False, True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("courses", nargs="+", metavar="COURSE")
    parser.add_argument("--gap", type=float, default=0.01, help="within which a bound is sought")
    chosen = parser.parse_args()
    print("| course | slowest plan | fastest plan | quick | by prices | gap, % |\n|---|---:|---:|---:|---:|---:|")
    for name in chosen.courses:
        inputs = load_inputs(name)
        course, mesh = inputs.race.course, inputs.settings.mesh
        point_mass = formulate(Stage.POINT_MASS, inputs.race, inputs.settings)
        with SolverService() as first, SolverService() as second, SolverPool([first, second]) as pool:
            solved = pool.work(planned_starts(point_mass, course, MANY), solve_coarse)
            flights = sorted((flight for flight in solved if flight is not None), key=lambda flight: flight.race_time)
            if not flights:
                print(f"| {Path(name).stem} | no plan leads to a flight |", flush=True)
                continue
            plans = planned_starts(point_mass, course, QUICK)
            quick = Search(point_mass, course, QUICK, pool, lambda _: None).run(plans).flights
            fastest, best, slowest = pool.work(
                [flights[0], quick[0] if quick else flights[0], flights[-1]],
                lambda service, flight: solve_finer(service, flight, mesh),
            )
            counts, cruise = [len(phase) for phase in slowest.problem.mesh], point_mass.plan.cruise
            starts = [finer_guess(plan, mesh, counts) for plan in (*own_plans(point_mass), *plans)]
            others = [RaceGuess.of(start) for start in starts]
            search = PriceSearch(slowest, others, course, cruise, mesh, pool, lambda _: None)
            *_, bound = search.rounds(chosen.gap)
        times = [flight.race_time for flight in (slowest, fastest, best, search.best)]
        cells = [Path(name).stem, *(f"{seconds:.3f}" for seconds in times), f"{100 * bound.gap:.2f}"]
        print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
