"""What an aircraft file may say of its propeller and of the linear loops, and what it is refused for."""

import math

import pytest
from language_texts import AIRCRAFT, edited, findings_of, understood

from airrace.aircraft.aircraft import Aircraft, LinearLoops, Mode

LINEAR = """
linear:
  speed_m_s: 90
  omega_z_rad_s: 8
  damping_z: 0.7
  omega_y_rad_s: 4
  damping_y: 0.3
  tau_p_s: 0.12
"""


def built(aircraft: str) -> Aircraft:
    return understood(aircraft=aircraft).race.aircraft


def test_a_propeller_acts_only_where_its_effects_are_asked_for() -> None:
    assert built(AIRCRAFT).propeller is None
    turning = built(edited(AIRCRAFT, "effects: false", "effects: true")).propeller
    assert turning is not None
    assert (turning.inertia, turning.Omega) == (5.26, pytest.approx(2700.0 * math.pi / 30.0))


def test_a_propeller_that_turns_left_turns_the_other_way() -> None:
    propeller = built(edited(AIRCRAFT, "effects: false", "effects: true\n  turns: left")).propeller
    assert propeller is not None
    assert propeller.Omega == pytest.approx(-2700.0 * math.pi / 30.0)


def test_an_aircraft_file_needs_to_know_neither() -> None:
    begin = AIRCRAFT.index("propeller:\n")
    without = AIRCRAFT[:begin] + AIRCRAFT[AIRCRAFT.index("surfaces:\n") :]
    assert (built(without).propeller, built(without).linear) == (None, None)
    assert built(without) == built(AIRCRAFT)


def test_constants_of_the_linear_loops_are_understood() -> None:
    assert built(AIRCRAFT + LINEAR).linear == LinearLoops(90.0, Mode(8.0, 0.7), Mode(4.0, 0.3), 0.12)
    assert built(AIRCRAFT + "linear: {speed_m_s: 80}\n").linear == LinearLoops(80.0)


@pytest.mark.parametrize(
    ("given", "column", "message"),
    [
        ("damping_z: 0.7", 25, "linear.damping_z: tells nothing without omega_z_rad_s; give both or neither"),
        ("omega_y_rad_s: 4", 25, "linear.omega_y_rad_s: tells nothing without damping_y; give both or neither"),
        (
            "omega_z_rad_s: 2, damping_z: 0.5",
            54,
            "linear.damping_z: the lift alone damps more than that; must be above 0.867",
        ),
    ],
)
def test_half_a_mode_or_too_little_damping_is_refused(given: str, column: int, message: str) -> None:
    line = AIRCRAFT.count("\n") + 1
    (finding,) = findings_of(aircraft=AIRCRAFT + f"linear: {{speed_m_s: 90, {given}}}\n")
    assert str(finding) == f"a.yaml:{line}:{column}: {message}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("C_meta: -1.0", "C_meta: -0.03", "pitch.C_meta: no elevator power: trimming a greater angle of attack costs"),
        ("C_nxi: 0.01", "C_nxi: 2.0", "yaw.C_nzeta: ailerons and rudder cannot be told apart"),
        ("C_Yzeta: 0.21", "C_Yzeta: 0.6", "side_force.C_Ybeta: a trimmed sideslip makes no side force"),
    ],
)
def test_an_aircraft_that_no_controller_could_fly_is_refused(old: str, new: str, message: str) -> None:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, old, new))
    assert f"{finding.key}: {finding.message}".startswith(message)
    assert finding.line > 0
