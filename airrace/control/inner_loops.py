"""Which inverse belongs to which model of the ladder."""

from collections.abc import Mapping

from airrace.control.inner_controller import InnerLoopInverse
from airrace.control.inversion_commands import invert_commands
from airrace.control.inversion_deflections import invert_six_dof, invert_state_space
from airrace.control.inversion_transfer_functions import invert_transfer_functions

INVERSES: Mapping[str, InnerLoopInverse] = {
    "transfer-function": invert_transfer_functions,
    "state-space-inversion": invert_commands,
    "state-space": invert_state_space,
    "six-dof": invert_six_dof,
}
"""By the name of the stage that flies the model."""


def inner_controller_for(stage: str) -> InnerLoopInverse:
    """The inverse of a stage's inner loop.

    Raises:
        KeyError: the stage's model has no inner loop.
    """
    return INVERSES[stage]
