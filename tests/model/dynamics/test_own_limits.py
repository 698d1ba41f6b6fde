"""Limits from outside the package, in the models."""

from pathlib import Path

import numpy as np
import pytest

from airrace.errors import UsageError
from airrace.files.inputs import load_inputs
from airrace.model.dynamics import own_limits
from airrace.model.dynamics.own_limits import UNITS, Instant, Limit, register
from airrace.model.environment import g0
from airrace.optimal_control.quantities import Quantity, Scalar
from airrace.procedure.certification import tolerances
from airrace.procedure.fidelity import stage_model
from airrace.procedure.settings import CertificateLimits
from airrace.procedure.stage import STAGES, Stage

TRACK = Path(__file__).parents[3] / "tracks" / "half_cuban_eight.yaml"
RACE = load_inputs(TRACK).race


def energy_height(instant: Instant) -> Scalar:
    return instant.height + instant.V_K**2 / (2.0 * g0)


def limit(name: str = "energy_height", unit: str = "m", lower: float = 0.0, upper: float = 500.0) -> Limit:
    return Limit(Quantity(name, unit, 100.0, lower, upper), energy_height)


@pytest.fixture(autouse=True)
def no_limits_remain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(own_limits, "_limits", {})


@pytest.mark.parametrize("stage", [stage for stage in STAGES if stage is not Stage.HOMOTOPY], ids=lambda s: s.value)
def test_every_model_has_the_limit_with_its_bounds_and_its_value(stage: Stage) -> None:
    without = stage_model(stage, RACE).system
    register(limit())
    model = stage_model(stage, RACE)
    *own, last = model.system.path
    assert tuple(own) == without.path
    assert (last.name, last.lower, last.upper) == ("energy_height", 0.0, 500.0)
    rng = np.random.default_rng(1)
    x = rng.uniform(0.5, 1.0, len(model.system.states))
    names = [quantity.name for quantity in model.system.states]
    x[names.index("z")], x[names.index("V_K")] = -30.0, 90.0
    u = rng.uniform(0.0, 0.1, len(model.system.controls))
    values = np.asarray(model.system.path_values(x, u, model.parameter_values)).ravel()
    assert values[-1] == pytest.approx(30.0 + 90.0**2 / (2.0 * g0))
    before = np.asarray(without.path_values(x, u, model.parameter_values)).ravel()
    assert values[:-1] == pytest.approx(before)


def test_models_are_as_before_without_a_limit() -> None:
    register(limit())
    name = stage_model(Stage.POINT_MASS, RACE).system.name
    own_limits._limits.clear()
    assert name.endswith("+energy_height")
    assert stage_model(Stage.POINT_MASS, RACE).system.name == name.removesuffix("+energy_height")


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (limit(unit="Pa"), "the unit of energy_height must be one of 1, 1/s, m, m/s, rad, rad/s; is 'Pa'"),
        (limit(upper=-1.0), "no value of energy_height lies between 0 and -1"),
    ],
)
def test_limit_that_cannot_be_kept_or_measured_is_refused(wrong: Limit, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        register(wrong)


def test_two_limits_of_a_name_are_refused() -> None:
    register(limit())
    with pytest.raises(ValueError, match="there is a limit energy_height already"):
        register(limit())


def test_limit_with_the_name_of_a_state_is_refused() -> None:
    register(limit("V_K"))
    with pytest.raises(UsageError, match="has a quantity V_K of its own; call your limit otherwise"):
        stage_model(Stage.POINT_MASS, RACE)


def test_limit_whose_function_fails_is_named_with_its_file_and_line() -> None:
    def failing(instant: Instant) -> Scalar:
        return instant.heigth  # type: ignore[attr-defined]

    register(Limit(limit().quantity, failing))
    with pytest.raises(UsageError, match=r"test_own_limits\.py has the limit energy_height, which fails in line \d+"):
        stage_model(Stage.POINT_MASS, RACE)


def test_certificates_have_a_tolerance_in_every_unit() -> None:
    known = {unit for tolerance in tolerances(CertificateLimits()) for unit in tolerance.units}
    assert set(UNITS) <= known
