"""The fidelities, one object each. This is the only list of them; a further one is added by `register`."""

import dataclasses
import functools

from airrace.control.inversion_body_motion import SIX_DOF, STATE_SPACE, STATE_SPACE_INVERSION, invert_body_motion
from airrace.control.inversion_transfer_functions import invert_transfer_functions
from airrace.dynamics.point_mass import build_point_mass
from airrace.dynamics.six_dof import build_six_dof
from airrace.dynamics.state_space import build_state_space
from airrace.dynamics.state_space_inversion import build_state_space_inversion
from airrace.dynamics.transfer_functions import build_transfer_functions
from airrace.extensions import load_extensions
from airrace.procedure.fidelity import Fidelity, Handover
from airrace.procedure.stage import Stage

LAGGING_INTERVAL = 0.1
"""The longest interval of the models that are flown by commands, s.

It is a little more than the roll mode's time constant, 0.08 s.
"""
SURFACE_INTERVAL = 0.07
"""The longest interval of the models whose surfaces are optimised, s.

With steps of 0.1 s, longer than the roll mode's time constant of 0.08 s, the discretised equations are so far from the
true ones that optima are found which nothing could fly.
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
            longest_interval=LAGGING_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE_INVERSION,
            build_state_space_inversion,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE_INVERSION),
            longest_interval=LAGGING_INTERVAL,
        ),
        Fidelity(
            Stage.STATE_SPACE,
            build_state_space,
            inner_controller=functools.partial(invert_body_motion, chain=STATE_SPACE),
            longest_interval=SURFACE_INTERVAL,
            handover=Handover(retold=Stage.STATE_SPACE_INVERSION),
        ),
        Fidelity(
            Stage.SIX_DOF,
            build_six_dof,
            inner_controller=functools.partial(invert_body_motion, chain=SIX_DOF),
            longest_interval=SURFACE_INTERVAL,
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
