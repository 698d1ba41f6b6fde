"""Measure the tables of docs/evidence/safety.md: closed-loop flights of stored runs, one disturbance at a time.

python scripts/measure_safety.py RUN.h5... [--flights 1000] [--reserve 0.9 0.99]
"""

import argparse
import time
from typing import Any

import numpy as np

import airrace
from airrace.flights.safety.monte_carlo import Count

CALM: dict[str, Any] = {  # Any: of many types
    "gusts": "none",
    "wind_error_kt": 0.0,
    "mass_error_percent": 0.0,
    "power_error_percent": 0.0,
    "density_error_percent": 0.0,
    "roll_timing_s": 0.0,
}
CASES = {
    "mass and power 2 %, density 1 %": {
        "mass_error_percent": 2.0,
        "power_error_percent": 2.0,
        "density_error_percent": 1.0,
    },
    "wind 2.5 kt north and east": {"wind_error_kt": 2.5},
    "rolls 20 ms": {"roll_timing_s": 0.02},
    "light gusts": {"gusts": "light"},
    "moderate gusts": {"gusts": "moderate"},
    "all of it, light gusts": None,
}
OTHER_SEED = 4711
"""Of flights by which no search has chosen."""
KINDS = ("pylon", "ground", "missed", "lost", "clearance", "height", "bank", "flight clearance", "floor", "load factor")


def interval_text(count: Count) -> str:
    """Return a share with its interval."""
    return f"{count.share:.3f} ({count.lower:.3f}-{count.upper:.3f})"


def measure_reserves(run: airrace.Run, path: str, probabilities: list[float]) -> None:
    """Print the reserves of a run in light gusts, and store each beside it."""
    print(
        f"\n| {run.name}, {run.race_time:.3f} s | predicted | measured | 1,000 others | over-g of these | cost "
        "| margin of n_z | margin of C_L | hindered by | seconds |"
    )
    print("|---" * 10 + "|", flush=True)
    for probability in probabilities:
        begin = time.perf_counter()
        case = run.reserve(probability)
        case.run.save(path.replace(".h5", f"_{probability:g}.h5"))
        margins = case.run.inputs.margins
        request = case.request
        options = request.model_dump(exclude={"probability", "load_factor", "found"})
        others = case.run.stages[-1].safety(flights=1000, seed=OTHER_SEED, **options).result
        cells = [
            f"{probability:g}" + ("" if case.reached else " (not reached)"),
            f"{case.predicted:.3f}",
            interval_text(case.measured),
            interval_text(Count.with_interval(others.flights - others.broken.flights, others.flights)),
            f"{others.counts['over-g'].flights}",
            f"{case.run.race_time - case.optimum:.3f}",
            f"{margins.get('rules.n_z_max', 0.0):.2f}",
            f"{margins.get('rules.C_L_max', 0.0):.2f}",
            ", ".join(case.binding),
            f"{time.perf_counter() - begin:.0f}",
        ]
        print(f"| {' | '.join(cells)} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="+")
    parser.add_argument("--flights", type=int, default=1000)
    parser.add_argument("--reserve", type=float, nargs="*", default=[], help="probabilities, measured instead")
    given = parser.parse_args()
    for path in given.runs:
        run = airrace.open(path)
        if given.reserve:
            measure_reserves(run, path, given.reserve)
            continue
        alone = [one.deviations for one in run.safety(flights=1, **CALM).result.gates]
        off = 1000.0 * max(abs(one[key].mean) for one in alone for key in ("lateral", "height"))
        bank = np.degrees(max(abs(one["bank"].mean) for one in alone))
        print(f"\n{run.name}, {run.race_time:.3f} s: undisturbed within {off:.1f} mm and {bank:.2f} deg at gates")
        print(f"\n| {run.name} | touch, miss or lose | {' | '.join(KINDS)} | linear/flights | seconds |", flush=True)
        print("|---|" + "---|" * (len(KINDS) + 3))
        for name, changed in CASES.items():
            begin = time.perf_counter()
            options = {} if changed is None else {**CALM, **changed}
            result = run.safety(flights=given.flights, **options).result
            contact = result.contact
            interval = f"{contact.flights} ({1000 * contact.lower:.0f}-{1000 * contact.upper:.0f} of 1000)"
            counts = " | ".join(str(result.counts[kind].flights) for kind in KINDS)
            # 95 % of a normal distribution lie within 1.96 standard deviations
            ratios = [
                1.96 * one.deviations[key].linear / one.deviations[key].quantiles[0]
                for one in result.gates[1:]
                for key in ("lateral", "height")
                if one.deviations[key].quantiles[0] > 0.01
            ]
            told = f"{np.median(ratios):.2f}"
            print(f"| {name} | {interval} | {counts} | {told} | {time.perf_counter() - begin:.0f} |", flush=True)


if __name__ == "__main__":
    main()
