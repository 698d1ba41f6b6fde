"""Which inverse belongs to which model of the ladder."""

import functools
from collections.abc import Mapping

from airrace.control.inner_controller import InnerLoopInverse
from airrace.control.inversion_body_motion import SIX_DOF, STATE_SPACE, STATE_SPACE_INVERSION, invert_body_motion
from airrace.control.inversion_transfer_functions import invert_transfer_functions

INVERSES: Mapping[str, InnerLoopInverse] = {
    "transfer-function": invert_transfer_functions,
    "state-space-inversion": functools.partial(invert_body_motion, chain=STATE_SPACE_INVERSION),
    "state-space": functools.partial(invert_body_motion, chain=STATE_SPACE),
    "six-dof": functools.partial(invert_body_motion, chain=SIX_DOF),
}
"""By the name of the stage that flies the model."""


def inner_controller_for(stage: str) -> InnerLoopInverse:
    """The inverse of a stage's inner loop.

    Args:
        stage: its name, as users write it.

    Raises:
        KeyError: the stage's model has no inner loop.
    """
    return INVERSES[stage]
