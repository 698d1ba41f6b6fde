"""The fidelities, one object each. This is the only list of them; a further one is added by `register`."""

import dataclasses
import functools

from airrace.control.dynamic_inversion import SIX_DOF, STATE_SPACE, STATE_SPACE_INVERSION, invert_body_motion
from airrace.control.inversion_transfer_functions import invert_transfer_functions
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.extensions import load_extensions
from airrace.optimal_control.runge_kutta import VERNER_7
from airrace.procedure.fidelity import Fidelity, WarmStart
from airrace.procedure.stage import Stage

LONGEST_INTERVAL = 0.13
"""The longest interval of the models with an inner loop, s.

Their roll mode's time constant is 0.08 s. In a step of 0.13 s the scheme of order 7 errs by 3e-5 of it; one of order 5
errs by 1e-2, so much that optima are found which nothing could fly. With order 7 and 0.13 s the ladder takes three
quarters of the time that it takes with order 5 and 0.07 to 0.1 s, with 0.16 s no less.
"""

_point_mass = Fidelity(Stage.POINT_MASS, build_point_mass)

_fidelities: dict[Stage, Fidelity] = {
    one.stage: one
    for one in (
        dataclasses.replace(_point_mass, stage=Stage.HOMOTOPY, guess=True),
        _point_mass,
        Fidelity(
            Stage.TRANSFER_FUNCTION,
            build_transfer_functions,
            inner_controller=invert_transfer_functions,
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE_INVERSION,
            build_state_space_inversion,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE_INVERSION),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE,
            build_state_space,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
            warm_start=WarmStart(same_dynamics_as=Stage.STATE_SPACE_INVERSION),
        ),
        Fidelity(
            Stage.SIX_DOF,
            build_six_dof,
            inner_controller=functools.partial(invert_body_motion, chain=SIX_DOF),
            scheme=VERNER_7,
            longest_interval=LONGEST_INTERVAL,
        ),
    )
}


def register(fidelity: Fidelity) -> Fidelity:
    """Add a fidelity to the ladder, at the place of its stage, and return it.

    A file that calls this is all that a fidelity of one's own takes: import it, or name it in `AIRRACE_EXTENSIONS`.

    Raises:
        ValueError: the stage is flown by another fidelity already, or the model has no inner controller by which it
            could be started from the stage below.
    """
    if fidelity.stage in _fidelities:
        raise ValueError(f"there is a fidelity for the stage {fidelity.stage.value} already")
    fidelity.controller()
    _fidelities[fidelity.stage] = fidelity
    return fidelity


def fidelity_of(stage: Stage) -> Fidelity:
    """Return the fidelity that flies a stage.

    Raises:
        KeyError: the stage was declared, but no fidelity was registered for it.
    """
    load_extensions()
    return _fidelities[stage]
