"""Extensions as an installed package in a fresh environment, made of nothing but what the how-tos say."""

import json
import os
import re
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]
HOW_TO = ROOT / "docs" / "how_to"
G0 = 9.80665
setuptools = pytest.importorskip("setuptools", minversion="70.1", reason="older ones build no wheels")
pytestmark = pytest.mark.slow


def block(page: str, language: str, part: str) -> str:
    """The block of a page in a language that holds a part."""
    text = (HOW_TO / page).read_text(encoding="utf-8")
    (found,) = (code for code in re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S) if part in code)
    return found


@pytest.fixture(scope="module")
def environment(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An environment with the wheel and the package; what both need is that of the running interpreter."""
    folder = tmp_path_factory.mktemp("extras")
    source = folder / "source"
    (source / "my_hangar").mkdir(parents=True)
    (source / "pyproject.toml").write_text(block("package.md", "toml", "air-extras"), encoding="utf-8")
    (source / "energy_height.py").write_text(block("limit.md", "python", "register(Limit"), encoding="utf-8")
    (source / "histories_json.py").write_text(block("export.md", "python", "register(Format"), encoding="utf-8")
    for name in ("ring.py", "first_order_roll.py"):  # those that the how-tos quote
        shutil.copy(ROOT / "tests" / "end_to_end" / name, source)
    (source / "my_hangar" / "__init__.py").touch()
    aircraft = (ROOT / "configs" / "edge540.yaml").read_text(encoding="utf-8")
    heavier = re.sub(r"mass_kg: [\d.]+", "mass_kg: 720", aircraft)
    (source / "my_hangar" / "my_extra.yaml").write_text(heavier, encoding="utf-8")
    fresh = folder / "environment"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", fresh], check=True)
    python = fresh / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    run = subprocess.run(
        [python, "-c", "import sysconfig; print(sysconfig.get_paths()['purelib'])"],
        capture_output=True,
        text=True,
        check=True,
    )
    libraries = [str(Path(setuptools.__file__).parents[1]), sysconfig.get_paths()["purelib"]]
    (Path(run.stdout.strip()) / "libraries.pth").write_text("\n".join(libraries) + "\n", encoding="utf-8")
    install = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-index", "--no-deps"]
    subprocess.run(
        [*install, "--no-build-isolation", "--ignore-installed", wheel, source],
        check=True,
        cwd=folder,
        env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"},
    )
    return python


def called(python: Path, folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if key not in ("PYTHONPATH", "AIRRACE_EXTENSIONS")}
    return subprocess.run(
        [python, "-m", "airrace", *words], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


@pytest.fixture(scope="module")
def flown(environment: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run with the limit and the aircraft of the package."""
    folder = tmp_path_factory.mktemp("flown")
    options = ("--until", "point-mass", "--search", "off", "--output", "run.h5", "--json", "--quiet")
    ran = called(environment, folder, "optimize", "rovinj_2014", "--aircraft", "my_extra", *options)
    assert ran.returncode == 0, ran.stderr
    answer = json.loads(ran.stdout)
    assert answer["certified"] is True
    return folder


def test_own_limit_is_kept_and_reached_and_own_export_writes_it(environment: Path, flown: Path) -> None:
    ran = called(environment, flown, "export", "json", "run.h5", "--output", "run.json")
    assert ran.returncode == 0, ran.stderr
    (histories,) = json.loads((flown / "run.json").read_text(encoding="utf-8")).values()
    energy = np.array(histories["height"]) + np.array(histories["V_K"]) ** 2 / (2.0 * G0)
    assert energy.max() == pytest.approx(560.0, abs=0.5)
    assert np.array(histories["energy_height"]) == pytest.approx(energy, abs=0.2)


def test_run_knows_the_package_and_its_aircraft(environment: Path, flown: Path) -> None:
    program = "from pathlib import Path; from airrace.files.checkpoint import read_checkpoint; import json; "
    program += "print(json.dumps(dict(read_checkpoint(Path('run.h5')).versions)))"
    ran = subprocess.run([environment, "-c", program], cwd=flown, capture_output=True, text=True, check=True)
    assert json.loads(ran.stdout)["air-extras:energy_height"].startswith("1.0, ")
    listed = called(environment, flown, "doctor").stdout
    assert "air-extras:ring" in listed
    assert called(environment, flown, "check", "rovinj_2014", "--aircraft", "my_extr").stderr.count("my_extra") == 1


def test_own_gate_and_own_fidelity_are_known(environment: Path, flown: Path) -> None:
    schema = json.loads(called(environment, flown, "schema", "track").stdout)
    assert schema["definitions"]["RingEntry"]["title"] == "a ring"
    refused = called(environment, flown, "optimize", "half_cuban_eight", "--until", "no-such-stage")
    assert "first-order-roll" in refused.stderr
