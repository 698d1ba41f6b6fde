"""Whatever a file says, it is understood or refused with findings that say why."""

import random
from collections import Counter
from pathlib import Path

import pytest
from language_texts import AIRCRAFT, RICH, ROOT
from mutations import MUTATIONS, mutated

from airrace.errors import Finding, InputError
from airrace.inputs import Document, Inputs, inputs_from_documents, load_inputs
from airrace.inputs.inputs import FINDINGS_MAX

SETTINGS = """\
schema: airrace/settings/1
guess: plan
regularisation: 1e-4
mesh: {interval_s: 0.1, intervals_min: 8}
solver: {primary: ipopt, fallback: fatrop, tolerance: 1e-8, stall_s: 60}
certificate: {angle_deg: 0.1}
"""
SHIPPED = [path.read_text(encoding="utf-8") for path in sorted((ROOT / "tracks").glob("*.yaml"))]
TRACKS = [*SHIPPED, *[RICH] * 6]


def loaded(track: str, aircraft: str, settings: str) -> Inputs | InputError:
    """What the texts are understood as, or how they are refused."""
    documents = (Document("t.yaml", track), Document("a.yaml", aircraft), Document("s.yaml", settings))
    try:
        return inputs_from_documents(*documents, ())
    except InputError as error:
        return error


def check_findings(findings: list[Finding]) -> None:
    """Every finding says something, in a bearable length; there are not too many."""
    assert findings
    for finding in findings:
        assert finding.message.strip()
        assert len(str(finding)) < 2000
        assert finding.file in ("t.yaml", "a.yaml", "s.yaml")
        assert (finding.line >= 1) == (finding.column >= 1)
    told = Counter(finding.file for finding in findings)
    assert max(told.values()) <= FINDINGS_MAX + 1


def survive(count: int, seed: int) -> Counter[str]:
    """Load so many spoilt inputs; how many were understood and refused."""
    choose = random.Random(seed)
    outcomes: Counter[str] = Counter()
    for index in range(count):
        texts = {"track": choose.choice(TRACKS), "aircraft": AIRCRAFT, "settings": SETTINGS}
        spoilt = choose.choices(list(texts), weights=(8, 1, 1))[0]
        texts[spoilt] = mutated(texts[spoilt], choose)
        try:
            found = loaded(**texts)
            if isinstance(found, InputError):
                check_findings(found.findings)
        except Exception as error:
            raise AssertionError(f"seed {seed}, mutation {index}, {spoilt}:\n{texts[spoilt][:5000]}") from error
        outcomes["refused" if isinstance(found, InputError) else "understood"] += 1
    return outcomes


def test_three_hundred_spoilt_files_are_understood_or_refused() -> None:
    outcomes = survive(300, seed=1)
    assert outcomes["refused"] > 150
    assert outcomes["understood"] > 15


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 12))
def test_a_thousand_spoilt_files_are_understood_or_refused(seed: int) -> None:
    assert survive(1000, seed).total() == 1000


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.__name__)
def test_every_mutation_changes_something_and_can_be_repeated(mutation: object) -> None:
    assert callable(mutation)
    texts = [mutation(RICH, random.Random(seed)) for seed in range(20)]
    assert texts == [mutation(RICH, random.Random(seed)) for seed in range(20)]
    assert sum(text != RICH for text in texts) > 10


def test_the_unspoilt_files_are_understood() -> None:
    for track in (*SHIPPED, RICH):
        assert isinstance(loaded(track, AIRCRAFT, SETTINGS), Inputs)


def test_files_of_any_bytes_are_refused(tmp_path: Path) -> None:
    choose = random.Random(3)
    for length in (0, 1, 2, 3, 10, 100, 10_000):
        file = tmp_path / "t.yaml"
        file.write_bytes(choose.randbytes(length))
        with pytest.raises(InputError) as raised:
            load_inputs(file, aircraft=ROOT / "configs/edge540.yaml")
        assert all(finding.message for finding in raised.value.findings)
