"""The homotopy of one phase: from a gate that is reached in level flight to the real one."""

import functools
import math

import numpy as np
import pytest
from races import RACES, planned

from airrace.dynamics.point_mass import PointMassState
from airrace.frames import angle_between, quaternion
from airrace.procedure.guess import first_mesh
from airrace.procedure.homotopy import PhaseHomotopy, phase_homotopy
from airrace.procedure.settings import MeshSettings
from airrace.trajectory import Array


@functools.cache
def families(name: str) -> list[PhaseHomotopy]:
    """All phases of a race, each beginning as planned."""
    plan = planned(RACES[name])
    return [phase_homotopy(plan, index, None) for index in range(len(plan.legs))]


LEVEL_PHASES = [(name, index) for name in RACES for index, one in enumerate(families(name)) if one.path is not None]
TURNING = [(name, index) for name in RACES for index, one in enumerate(families(name)) if one.path is None]
every_level_phase = pytest.mark.parametrize(("name", "index"), LEVEL_PHASES)
every_phase = pytest.mark.parametrize(("name", "index"), [*LEVEL_PHASES, *TURNING])


@every_phase
def test_whole_family_ends_at_the_real_gate(name: str, index: int) -> None:
    family = families(name)[index]
    assert family.target(1.0) == planned(RACES[name]).waypoints[index + 1]


@every_level_phase
def test_first_member_is_straight_and_level_with_both_gates_in_line(name: str, index: int) -> None:
    family = families(name)[index]
    begin, target = family.begin, family.target(family.first)
    assert family.first == 0.0
    assert family.path is not None
    assert begin.position is not None
    assert target.position is not None
    assert target.heading == pytest.approx(begin.heading)
    assert target.position[2] == begin.position[2]
    reach = family.path.length
    north = begin.position[0] + reach * math.cos(begin.heading)
    east = begin.position[1] + reach * math.sin(begin.heading)
    assert target.position[:2] == pytest.approx((north, east))
    assert target.climb == 0.0
    assert not target.bank


@every_level_phase
def test_members_lead_steadily_from_the_first_to_the_last(name: str, index: int) -> None:
    """Heading and bank of the gate grow in proportion to the part, its position without a jump."""
    family = families(name)[index]
    assert family.path is not None
    parts = np.linspace(0.0, 1.0, 41)
    targets = [family.target(float(part)) for part in parts]
    turn = sum(
        length * curvature for length, curvature in zip(family.path.lengths, family.path.curvatures, strict=True)
    )
    for part, target in zip(parts, targets, strict=True):
        assert abs(angle_between(target.heading, family.begin.heading + part * turn)) < 1e-6
        assert (target.bank or 0.0) == pytest.approx(part * (family.end.bank or 0.0))
    places = np.array([target.position for target in targets])
    # A gate moves along at most as far as the whole path would swing around.
    assert np.linalg.norm(np.diff(places, axis=0), axis=1).max() < 2.0 * math.pi * family.path.length / 40.0


@every_level_phase
def test_guess_of_a_member_ends_at_its_target(name: str, index: int) -> None:
    family = families(name)[index]
    fractions = first_mesh(planned(RACES[name]), MeshSettings())[index]
    for part in (0.0, 0.4, 1.0):
        state = PointMassState[Array].split(family.guess(part, fractions).state)
        position = family.target(part).position
        assert position is not None
        assert [state.x[-1], state.y[-1], -state.z[-1]] == pytest.approx(list(position), abs=1e-6)


@pytest.mark.parametrize(("name", "index"), TURNING)
def test_between_free_attitudes_the_real_phase_is_the_first_member(name: str, index: int) -> None:
    assert families(name)[index].first == 1.0


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


def test_phase_begins_where_the_one_before_really_ended() -> None:
    plan = planned(RACES["four_gates"])
    family = arrived("four_gates", 1, 0.7, 75.0)
    gate = plan.waypoints[1].position
    assert gate is not None
    assert family.begin.position == pytest.approx((gate[0] + 3.0, gate[1], gate[2]))
    assert family.begin.heading == pytest.approx(
        math.remainder(plan.waypoints[1].heading + math.radians(5.0), 2.0 * math.pi)
    )
    assert (family.begin.climb, family.begin.bank) == (pytest.approx(0.1), pytest.approx(0.7))
    assert family.pace.V == 75.0


def test_phase_keeps_its_planned_path_although_it_begins_beside_it() -> None:
    plan = planned(RACES["four_gates"])
    assert arrived("four_gates", 1, 0.0, 75.0).path == plan.legs[1].path
    assert arrived("four_gates", 1, 0.0, 75.0).target(1.0) == plan.waypoints[2]
