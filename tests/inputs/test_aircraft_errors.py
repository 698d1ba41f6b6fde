"""Aircraft that could not fly are refused in their own terms, and none that could."""

import pytest
from language_texts import AIRCRAFT, edited, findings_of, understood


def finding_in_aircraft(old: str, new: str) -> str:
    (finding,) = findings_of(aircraft=edited(AIRCRAFT, old, new))
    return str(finding)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        (
            "C_Lalpha: 4.8",
            "C_Lalpha: 0",
            "lift.C_Lalpha: lift must grow with the angle of attack; must be above 0 per rad",
        ),
        ("C_L_max: 1.40", "C_L_max: -0.1", "lift.C_L_max: the wing stalls before it lifts; must be above 0"),
        ("C_L_min: -1.40", "C_L_min: 0", "lift.C_L_min: the wing must be able to push down, too; must be below 0"),
        (
            "wing_area_m2: 9.10",
            "wing_area_m2: 0",
            "airframe.wing_area_m2: an aircraft without a wing has no lift; must be above 0",
        ),
        (
            "C_L_max: 1.40",
            "C_L_max: 0.05",
            (
                "lift.C_L_max: the wing cannot carry the aircraft: at 130 m/s, the envelope's top speed, C_L_max = "
                "0.05 lifts 4710 N at sea level, the weight is 6845 N"
            ),
        ),
        (
            "I_z_kg_m2: 1300",
            "I_z_kg_m2: 1500",
            "airframe.I_z_kg_m2: no body has such a moment of inertia: 1500 is more than the other two together, 1420",
        ),
        ("C_lxi: -0.31", "C_lxi: 0.31", "roll.C_lxi: must be at least -10 and below 0, not 0.31"),
    ],
)
def test_an_aircraft_that_could_not_fly_is_refused_in_its_own_terms(old: str, new: str, message: str) -> None:
    line = AIRCRAFT[: AIRCRAFT.index(old)].count("\n") + 1
    column = 3 + old.index(":") + 2
    assert finding_in_aircraft(old, new) == f"a.yaml:{line}:{column}: {message}"


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
    assert (built.lift.C_L0, built.lift.C_L_min, built.pitch.zero, built.airframe.I_xz) == (0.305, -0.8, 0.06, 203.0)
