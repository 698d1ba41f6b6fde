"""A changed run through the real command: started from the last optimum, certified, verified, compared."""

from pathlib import Path

import pytest
from airrace_command import HALF_CUBAN, POINT_MASS, airrace

FASTER = ("--set", "rules.n_z_max=9.5")


@pytest.mark.slow
def test_changed_run_ends_where_a_run_from_scratch_ends_or_earlier(tmp_path: Path) -> None:
    plan = ("--guess", "plan", "--search", "off", "--quiet", "--json")
    before = airrace("optimize", HALF_CUBAN, *POINT_MASS, *plan, "--output", "RUN.h5", cwd=tmp_path)
    scratch = airrace("optimize", HALF_CUBAN, *POINT_MASS, *plan, *FASTER, "--output", "SCRATCH.h5", cwd=tmp_path)
    stored = (tmp_path / "RUN.h5").read_bytes()
    changed = airrace("resume", "RUN.h5", *FASTER, "--output", "NEW.h5", "--quiet", "--json", cwd=tmp_path)
    assert (changed.code, changed.answer["certified"]) == (0, True)
    assert (tmp_path / "RUN.h5").read_bytes() == stored
    assert changed.race_time <= scratch.race_time + 5e-3
    compared = changed.answer["compared"]
    assert isinstance(compared, dict)
    difference = compared["race_time_s"]["difference"]
    assert difference == pytest.approx(changed.race_time - before.race_time, abs=1e-9)
    assert sum(leg["difference"] for leg in compared["legs"]) == pytest.approx(difference, abs=1e-6)
    assert airrace("verify", "NEW.h5", cwd=tmp_path).code == 0
