"""A warm kernel cache for benchmarks: no run waits for the compiler, so runs may leave it half empty."""

from collections.abc import Iterable
from pathlib import Path

from airrace.documents.inputs import load_inputs
from airrace.errors import KernelError
from airrace.optimal_control.kernels import compile_kernels
from airrace.procedure.fidelities import fidelity_of
from airrace.procedure.models import stage_model
from airrace.procedure.stage import STAGES, Stage


def compile_models(courses: Iterable[str | Path], until: Stage = Stage.SIX_DOF) -> None:
    """Compile the models of all stages up to one, as the races of these courses fly them, where there is a compiler."""
    for course in courses:
        race = load_inputs(course).race
        for stage in STAGES[STAGES.index(Stage.POINT_MASS) : STAGES.index(until) + 1]:
            try:
                compile_kernels(stage_model(stage, race).system, fidelity_of(stage).scheme)
            except KernelError as error:
                print(f"nothing is compiled: {error}")
                return
