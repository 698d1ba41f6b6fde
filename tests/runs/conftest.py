"""Fixtures of the tests of runs."""

import pytest

from airrace.files.checkpoint.checkpoint import content_digest
from airrace.optimal_control.solvers.service import SolverService
from airrace.procedure import recomputation
from airrace.procedure.recomputation import Measured, TrustedData
from airrace.procedure.settings import Settings
from airrace.race import Race

measure = recomputation.measure
MEASURED: dict[str, Measured] = {}


@pytest.fixture
def measured_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is believed is measured once: whatever else a file says, the same follows from it."""

    def once(race: Race, settings: Settings, trusted: TrustedData, service: SolverService) -> Measured:
        key = content_digest(trusted) + repr(race)
        if key not in MEASURED:
            MEASURED[key] = measure(race, settings, trusted, service)
        return MEASURED[key]

    monkeypatch.setattr(recomputation, "measure", once)
