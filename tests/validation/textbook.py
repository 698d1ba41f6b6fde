"""All problems with known answers, and how an answer moves as the mesh is refined."""

from collections.abc import Iterator
from dataclasses import replace

import beam
import catalyst_mixing
import delta_iii
import double_integrator
import dynamic_soaring
import fuller
import goddard_rocket
import hang_glider
import hanging_chain
import heated_shuttle
import least_time_turn
import level_turn
import limited_rocket
import lofted_rocket
import moon_lander
import numpy as np
import particle_steering
import quadrotor
import reorientation
import robot_arm
import sliding_mass
import terminal_bunt
import van_der_pol
from statement import KnownAnswer

from airrace.optimal_control.mesh_refinement import divide
from airrace.optimal_control.replay import replay
from airrace.optimal_control.solvers.solver import ProgramSolution

PROBLEMS = (
    sliding_mass,
    double_integrator,
    level_turn,
    hang_glider,
    dynamic_soaring,
    terminal_bunt,
    reorientation,
    lofted_rocket,
    heated_shuttle,
    delta_iii,
    goddard_rocket,
    robot_arm,
    particle_steering,
    catalyst_mixing,
    hanging_chain,
    van_der_pol,
    beam,
    fuller,
    moon_lander,
    quadrotor,
    least_time_turn,
    limited_rocket,
)


def known_answers() -> tuple[KnownAnswer, ...]:
    """Of all problems, in their order."""
    return tuple(answer for problem in PROBLEMS for answer in problem.known_answers())


def refined(answer: KnownAnswer, solution: ProgramSolution) -> KnownAnswer:
    """The same with every interval halved, to be solved from where the solution is."""
    problem = answer.problem
    twice = np.full(problem.intervals, 2)
    fractions, guess = divide(problem.mesh, solution.iterate, replay(problem, solution.iterate), twice)
    phases = tuple(replace(phase, fractions=finer) for phase, finer in zip(problem.phases, fractions, strict=True))
    options = replace(answer.options, barrier=1e-4)
    return replace(answer, problem=replace(problem, phases=phases), guess=guess, options=options)


def refinements(answer: KnownAnswer, count: int) -> Iterator[tuple[KnownAnswer, ProgramSolution]]:
    """The answer on its own mesh, then on finer ones."""
    yield answer, (solution := answer.solve())
    for _ in range(count):
        answer = refined(answer, solution)
        yield answer, (solution := answer.solve())
