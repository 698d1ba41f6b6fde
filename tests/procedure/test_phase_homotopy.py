"""The homotopy of one phase: from a gate that is reached in level flight to the real one."""

import functools
import math

import numpy as np
import pytest
from races import RACES, planned

from airrace.model.dynamics.point_mass import PointMassState
from airrace.model.frames import angle_between, quaternion
from airrace.optimal_control.trajectory import Array
from airrace.procedure.guess import first_mesh
from airrace.procedure.homotopy import PhaseHomotopy, phase_homotopy
from airrace.procedure.settings import MeshSettings


@functools.cache
def families(name: str) -> list[PhaseHomotopy]:
    """All phases of a race, each beginning as planned."""
    plan = planned(RACES[name])
    return [phase_homotopy(plan, index, None) for index in range(len(plan.legs))]


LEVEL_PHASES = [(name, index) for name in RACES for index, one in enumerate(families(name)) if one.path is not None]
TURNING = [(name, index) for name in RACES for index, one in enumerate(families(name)) if one.path is None]
every_level_phase = pytest.mark.parametrize(("name", "index"), LEVEL_PHASES)


@pytest.mark.parametrize(("name", "index"), [*LEVEL_PHASES, *TURNING])
def test_whole_family_ends_at_the_real_gate_and_between_free_attitudes_begins_there(name: str, index: int) -> None:
    family = families(name)[index]
    assert family.target(1.0) == planned(RACES[name]).waypoints[index + 1]
    assert family.first == (0.0 if (name, index) in LEVEL_PHASES else 1.0)


@every_level_phase
def test_first_member_is_straight_and_level_with_both_gates_in_line(name: str, index: int) -> None:
    family = families(name)[index]
    begin, target = family.begin, family.target(family.first)
    assert family.path is not None
    assert begin.position is not None
    assert target.position is not None
    assert target.heading == pytest.approx(begin.heading)
    north, east, height = begin.position
    reach = family.path.length
    line = (north + reach * math.cos(begin.heading), east + reach * math.sin(begin.heading))
    assert target.position == (pytest.approx(line[0]), pytest.approx(line[1]), height)
    assert target.climb == 0.0
    assert not target.bank


@every_level_phase
def test_members_lead_steadily_from_the_first_to_the_last_and_their_guesses_end_at_them(name: str, index: int) -> None:
    """Heading and bank of the gate grow in proportion to the part, its position without a jump."""
    family = families(name)[index]
    path = family.path
    assert path is not None
    parts = np.linspace(0.0, 1.0, 41)
    targets = [family.target(float(part)) for part in parts]
    turn = sum(length * curvature for length, curvature in zip(path.lengths, path.curvatures, strict=True))
    for part, target in zip(parts, targets, strict=True):
        assert abs(angle_between(target.heading, family.begin.heading + part * turn)) < 1e-6
        assert (target.bank or 0.0) == pytest.approx(part * (family.end.bank or 0.0))
    places = np.array([target.position for target in targets])
    # A gate moves along at most as far as the whole path would swing around.
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 2.0 * math.pi * path.length / 40.0
    fractions = first_mesh(planned(RACES[name]), MeshSettings())[index]
    for part in (0.0, 0.4, 1.0):
        state = PointMassState[Array].split(family.guess(part, fractions).state)
        position = family.target(part).position
        assert position is not None
        assert [state.x[-1], state.y[-1], -state.z[-1]] == pytest.approx(list(position), abs=1e-6)


def arrived(name: str, index: int, bank: float, speed: float) -> PhaseHomotopy:
    """The family of a phase that begins 3 m beside its gate, 5 degrees off its heading."""
    plan = planned(RACES[name])
    gate = plan.waypoints[index]
    assert gate.position is not None
    q0, q1, q2, q3 = quaternion(gate.heading + math.radians(5.0), 0.1, bank)
    state = PointMassState[float](
        x=gate.position[0] + 3.0, y=gate.position[1], z=-gate.position[2], V_K=speed, q0=q0, q1=q1, q2=q2, q3=q3,
        delta_T=1.0, n_z=2.0, n_y=0.0, p_Kbar=0.0,
    )  # fmt: skip
    return phase_homotopy(plan, index, np.array(state.join()))


def test_phase_begins_where_the_one_before_really_ended_but_keeps_its_planned_path() -> None:
    plan, family = planned(RACES["four_gates"]), arrived("four_gates", 1, 0.7, 75.0)
    gate, begin = plan.waypoints[1], family.begin
    assert gate.position is not None
    assert begin.position == pytest.approx((gate.position[0] + 3.0, *gate.position[1:]))
    assert angle_between(begin.heading, gate.heading) == pytest.approx(math.radians(5.0))
    assert (begin.climb, begin.bank) == (pytest.approx(0.1), pytest.approx(0.7))
    assert family.pace.V == 75.0
    assert family.path == plan.legs[1].path
    assert family.target(1.0) == plan.waypoints[2]
