"""Aircraft files: options and errors."""

import math

import pytest
from language_texts import AIRCRAFT, Refusal, edited, findings_of, refusals, understood

from airrace.model.aircraft import Aircraft, LinearLoops, Mode, Propeller

REFUSED = r"""
C_Lalpha: 4.8 => C_Lalpha: 0
> lift.C_Lalpha: lift must grow with the angle of attack; must be above 0 per rad
C_L_max: 1.40 => C_L_max: -0.1
> lift.C_L_max: the wing stalls before it lifts; must be above 0
C_L_min: -1.40 => C_L_min: 0
> lift.C_L_min: the wing must be able to push down, too; must be below 0
wing_area_m2: 9.10 => wing_area_m2: 0
> airframe.wing_area_m2: an aircraft without a wing has no lift; must be above 0
C_L_max: 1.40 => C_L_max: 0.05
> lift.C_L_max: the wing cannot carry the aircraft: at 130 m/s, the envelope's top speed, C_L = 0.05 lifts 4710 N
>   at sea level, the weight is 6845 N
I_z_kg_m2: 1300 => I_z_kg_m2: 1500
> airframe.I_z_kg_m2: no body has such a moment of inertia: 1500 is more than the other two together, 1420
C_lxi: -0.31 => C_lxi: 0.31
> roll.C_lxi: must be at least -10 and below 0, not 0.31
"""


@pytest.mark.parametrize("case", refusals(REFUSED), ids=str)
def test_an_aircraft_that_could_not_fly_is_refused_in_its_own_terms(case: Refusal) -> None:
    ((old, new),), (message,) = case.changes, case.findings
    line = AIRCRAFT[: AIRCRAFT.index(old)].count("\n") + 1
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, old, new))
    assert str(finding) == f"a.yaml:{line}:{3 + old.index(':') + 2}: {message}"


def test_an_unsymmetric_aircraft_with_camber_fits_the_language() -> None:
    aircraft = AIRCRAFT
    for old, new in (
        ("C_L0: 0 ", "C_L0: 0.305 "),
        ("C_L_min: -1.40", "C_L_min: -0.8"),
        ("C_m0: 0\n", "C_m0: 0.06\n"),
        ("I_xz_kg_m2: 0\n", "I_xz_kg_m2: 203\n"),
    ):
        aircraft = edited(aircraft, old, new)
    built = understood(aircraft=aircraft).race.aircraft
    assert (built.lift.C_L0, built.lift.C_L_min, built.pitch.C_m0, built.airframe.I_xz) == (0.305, -0.8, 0.06, 203.0)


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
    for turns, sign in (("", 1.0), ("\n  turns: left", -1.0)):
        propeller = built(edited(AIRCRAFT, "effects: false", f"effects: true{turns}")).propeller
        assert propeller == Propeller(5.26, pytest.approx(sign * 2700.0 * math.pi / 30.0))


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
        ("damping_z: 0.7", 25, "linear.damping_z: has no meaning without omega_z_rad_s; set both or neither"),
        ("omega_y_rad_s: 4", 25, "linear.omega_y_rad_s: has no meaning without damping_y; set both or neither"),
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
        ("C_nxi: 0.01", "C_nxi: 2.0", "yaw.C_nzeta: ailerons and rudder cannot be distinguished"),
        ("C_Yzeta: 0.21", "C_Yzeta: 0.6", "side_force.C_Ybeta: a trimmed sideslip makes no side force"),
    ],
)
def test_an_aircraft_that_no_controller_could_fly_is_refused(old: str, new: str, message: str) -> None:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, old, new))
    assert f"{finding.key}: {finding.message}".startswith(message)
    assert finding.line > 0
