"""Single values given with `--set`: what they reach, and how errors in them are told."""

import pytest
from language_texts import findings_of, understood


def test_overrides_reach_all_three_documents() -> None:
    inputs = understood(
        overrides=(
            "rules.n_z_max=1.2e1",
            "environment.wind.from_deg=90",
            "environment.wind.speed_m_s=8",
            "settings.regularisation=1e-3",
            "aircraft.airframe.mass_kg=720",
            "name=no",
            "gates.g0.type=level",
            "course.lap.0=g2",
            "course.lap.1.gate=g1",
            "course.lap.1.direction=null",
        )
    )
    assert inputs.race.course.rules.n_z.upper == 12.0
    assert inputs.race.air.wind is not None
    assert inputs.race.air.wind.speed == 8.0
    assert inputs.settings.regularisation == 1e-3
    assert inputs.race.aircraft.airframe.m == 720.0
    assert inputs.race.course.name == "no"
    assert [passage.name for passage in inputs.race.course.passages][1:3] == ["1:g2", "1:g1"]


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("rules.n_z_max", "--set: rules.n_z_max: `rules.n_z_max` is not of the form key=value, e.g. rules.n_z_max=12"),
        ("rules.n_z_max=99", "--set: rules.n_z_max: must be above 1 and at most 25, not 99"),
        ("rules.n_zmax=9", "--set: rules.n_zmax: unknown key `n_zmax`; did you mean `n_z_max`?"),
        (
            "rules.n_z_max=012",
            "--set: rules.n_z_max: `012` is ambiguous (YAML 1.1 takes it as octal); write `12`, or quote it as text",
        ),
        ("rules.n_z_max=[1]", "--set: rules.n_z_max: only a single value can be set; edit the file for more"),
        ("name.first=x", "--set: name.first: `first` cannot be set inside the single value 'Test'"),
        ("course.lap.9=g1", "--set: course.lap.9: the list has items 0 to 3, none named `9`"),
        (
            "settings.certificate.kkt_error=1",
            "--set: settings.certificate.kkt_error: limits can only be tightened: must be at most 1e-06, not 1",
        ),
    ],
)
def test_an_error_in_an_override_names_the_option(override: str, message: str) -> None:
    (finding,) = findings_of(overrides=(override,))
    assert str(finding) == message
