"""What is published says the same everywhere, and what builds it is well formed."""

import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

ROOT = Path(__file__).parents[1]
GITHUB = ROOT / ".github"
WORKFLOWS = sorted((GITHUB / "workflows").glob("*.yml"))
ACTION = GITHUB / "actions" / "fly" / "action.yml"
PROJECT: dict[str, Any] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))  # Any: TOML
REPOSITORY, TAG = "https://forge.example/owner/airrace", "v0.1.0"


def read(path: Path) -> Any:  # Any: YAML of any shape
    return yaml.safe_load(path.read_text(encoding="utf-8"))


def schema_errors(schema: str, *files: Path) -> str:
    """What the published schema of a kind of file, as check-jsonschema brings it along, finds wrong."""
    command = [sys.executable, "-m", "check_jsonschema", "--builtin-schema", f"vendor.{schema}", *map(str, files)]
    checked = subprocess.run(command, capture_output=True, text=True, check=False)
    return checked.stdout + checked.stderr if checked.returncode else ""


@pytest.mark.parametrize(
    ("schema", "files"),
    [
        ("github-workflows", WORKFLOWS),
        ("github-actions", [ACTION]),
        ("github-issue-forms", sorted((GITHUB / "ISSUE_TEMPLATE").glob("*.yml"))),
        ("dependabot", [GITHUB / "dependabot.yml"]),
        ("citation-file-format", [ROOT / "CITATION.cff"]),
    ],
)
def test_every_file_for_the_forge_follows_its_schema(schema: str, files: list[Path]) -> None:
    assert files
    assert schema_errors(schema, *files) == ""


def test_a_slip_in_a_workflow_is_found(tmp_path: Path) -> None:
    slip = tmp_path / "slip.yml"
    slip.write_text(WORKFLOWS[0].read_text(encoding="utf-8").replace("runs-on:", "run-on:"), encoding="utf-8")
    assert "runs-on" in schema_errors("github-workflows", slip)


def test_the_workflow_in_the_pages_follows_the_schema_and_gives_inputs_that_the_action_knows(tmp_path: Path) -> None:
    page = (ROOT / "docs" / "how_to" / "ci.md").read_text(encoding="utf-8")
    (text,) = re.findall(r"^```yaml\n(# \.github/workflows/.*?)^```$", page, re.MULTILINE | re.DOTALL)
    path = tmp_path / "courses.yml"
    path.write_text(text, encoding="utf-8")
    assert schema_errors("github-workflows", path) == ""
    (fly,) = (step for step in read(path)["jobs"]["fly"]["steps"] if "/.github/actions/fly@" in step.get("uses", ""))
    inputs = read(ACTION)["inputs"]
    assert {name for name, one in inputs.items() if one.get("required")} <= fly["with"].keys() <= inputs.keys()


def used_actions(node: Any) -> Iterator[str]:  # Any: YAML of any shape
    for key, value in node.items() if isinstance(node, dict) else enumerate(node):
        if key == "uses":
            yield value
        elif isinstance(value, dict | list):
            yield from used_actions(value)


def test_actions_are_pinned_by_their_major_version() -> None:
    used = {action for path in (*WORKFLOWS, ACTION) for action in used_actions(read(path))}
    assert {action for action in used if not re.fullmatch(r"[\w/-]+@(v\d+|release/v\d+)", action)} == set()


def test_workflows_may_only_read_but_for_the_jobs_that_publish() -> None:
    writing = {}
    for path in WORKFLOWS:
        workflow = read(path)
        assert workflow["permissions"] == {"contents": "read"}, path.name
        writing |= {
            f"{path.stem}.{name}": job["permissions"] for name, job in workflow["jobs"].items() if "permissions" in job
        }
    assert writing == {
        "documentation.deploy": {"pages": "write", "id-token": "write"},
        "release.publish": {"id-token": "write"},
    }


def test_every_python_that_is_claimed_is_tested() -> None:
    prefix = "Programming Language :: Python :: 3."
    classifiers = PROJECT["project"]["classifiers"]
    claimed = {one.removeprefix("Programming Language :: Python :: ") for one in classifiers if one.startswith(prefix)}
    tested = read(GITHUB / "workflows" / "tests.yml")["jobs"]["tests"]["strategy"]["matrix"]["python"]
    assert claimed <= set(tested)
    assert PROJECT["project"]["requires-python"] == f">={tested[0]}"


def test_the_package_is_what_the_citation_says() -> None:
    citation, project = read(ROOT / "CITATION.cff"), PROJECT["project"]
    assert project["version"] == citation["version"]
    assert project["license"] == citation["license"]
    assert project["authors"] == citation["authors"]
    assert project["keywords"] == citation["keywords"]


def test_the_conda_recipe_asks_for_what_the_package_asks_for() -> None:
    recipe, project = read(ROOT / "scripts" / "packaging" / "recipe.yaml"), PROJECT["project"]
    needed = {f"python{project['requires-python']}", *(one.split(";")[0].strip() for one in project["dependencies"])}
    run = [one["then"] if isinstance(one, dict) else one for one in recipe["requirements"]["run"]]
    assert {one.replace(" ", "") for one in run} == needed
    built = {re.split(r"[<>=;\[ ]", one)[0] for one in PROJECT["build-system"]["requires"]}
    assert built <= {one.split()[0] for one in recipe["requirements"]["host"]}
    assert recipe["context"]["version"] == project["version"]
    assert recipe["about"]["summary"] == project["description"]


def test_no_link_of_a_released_readme_is_relative(tmp_path: Path) -> None:
    script = Path("scripts", "packaging", "absolute_links.py")
    for name in (script, Path("README.md"), Path("pyproject.toml")):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_bytes((ROOT / name).read_bytes())
    subprocess.run([sys.executable, str(tmp_path / script), REPOSITORY, TAG], check=True)
    readme = (tmp_path / "README.md").read_text(encoding="utf-8")
    assert re.findall(r"\]\((?!https:)[^)]*\)", readme) == []
    for address in re.findall(r"\((https://forge[^)]*)\)", readme):
        kind, _, path = address.removeprefix(f"{REPOSITORY}/").partition(f"/{TAG}/")
        assert kind == ("raw" if path.endswith((".png", ".jpg")) else "blob")
        assert (ROOT / path).exists(), path
    released = tomllib.loads((tmp_path / "pyproject.toml").read_text(encoding="utf-8"))
    assert released["project"].pop("urls")["Repository"] == REPOSITORY
    assert released == PROJECT
