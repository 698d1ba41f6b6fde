"""Modules joined into one script: each behind what it imports, in the forms that are known, or not at all."""

import re
import subprocess
from pathlib import Path

import pytest

from airrace.report.script import FOLDER, joined, page_script

MODULES = sorted((FOLDER / "script").glob("*.js"))


def written(folder: Path, **modules: str) -> Path:
    for name, text in modules.items():
        (folder / f"{name}.js").write_text(text, encoding="utf-8")
    return folder / "main.js"


def test_a_module_stands_behind_what_it_imports(tmp_path: Path) -> None:
    main = written(
        tmp_path,
        main='import { far } from "./a.js";\nimport { near } from "./b.js";\nfar(near);\n',
        a='import { near } from "./b.js";\nexport function far() { return near; }\n',
        b="export const near = 1;\n",
    )
    assert re.findall(r"^// (\w+)\.js", joined(main), re.MULTILINE) == ["b", "a", "main"]


def test_both_forms_of_imports_and_exports_become_plain_objects(tmp_path: Path) -> None:
    main = written(
        tmp_path,
        main='import {\n  One,\n  two as second,\n} from "./small.js";\nnew One(second);\n',
        small='/* minified */\nimport{three as t}from"./core.js";class O{}const w=t;export{O as One,w as two};',
        core="export class Other {}\nexport const three = 3;",
    )
    script = joined(main)
    assert "const {three: t} = modules[0];" in script
    assert "return {One: O, two: w};" in script
    assert "const {One, two: second} = modules[1];" in script
    assert "return {Other, three};" in script
    assert not re.search(r"\b(import|export)\b", script)


def test_what_is_passed_on_from_another_module_is_exported(tmp_path: Path) -> None:
    main = written(
        tmp_path,
        main='import { two } from "./a.js";\ntwo();',
        a='export{one as two}from"./b.js";',
        b="export const one = 1;",
    )
    assert "return {two: modules[0].one};" in joined(main)


def test_modules_in_a_circle_are_refused(tmp_path: Path) -> None:
    main = written(tmp_path, main='import { a } from "./a.js";', a='import { b } from "./main.js";')
    with pytest.raises(ValueError, match=r"main\.js imports itself"):
        joined(main)


@pytest.mark.parametrize(
    "line", ['import "./a.js";', 'import * as a from "./a.js";', "export default 1;", "export let a = 1;"]
)
def test_other_forms_are_refused_rather_than_left_in(tmp_path: Path, line: str) -> None:
    with pytest.raises(ValueError, match="has a form that is not known"):
        joined(written(tmp_path, main=line, a=""))


@pytest.mark.parametrize("text", ["</script>", "</SCRIPT >", "<!--"])
def test_nothing_that_would_end_the_script_in_a_page_is_let_in(tmp_path: Path, text: str) -> None:
    with pytest.raises(ValueError, match="end the script"):
        joined(written(tmp_path, main=f'const text = "{text}";'))


def test_every_module_is_part_of_the_page() -> None:
    script = page_script()
    assert [path.name for path in MODULES if f"// {path.name}\n" not in script] == []


def test_no_module_holds_two_ideas() -> None:
    """As of the package itself: at most 400 lines, and a first line that says what the module is for."""
    for path in [*MODULES, *sorted((FOLDER / "style").glob("*.css"))]:
        lines = path.read_text(encoding="utf-8").splitlines()
        assert len(lines) <= 400, path.name
        assert lines[0].startswith(("// ", "/* ")), path.name


def test_no_module_writes_html_or_asks_a_network() -> None:
    """Texts reach the page as texts; nothing is fetched, evaluated or stored."""
    forbidden = (
        r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function"
        r"|fetch\(|XMLHttp|WebSocket|import\(|localStorage"
    )
    assert [path.name for path in MODULES if re.search(forbidden, path.read_text(encoding="utf-8"))] == []


def test_the_text_of_the_script_is_the_same_every_time() -> None:
    page_script.cache_clear()
    first = page_script()
    page_script.cache_clear()
    assert page_script() == first


def test_the_modules_are_in_the_wheel_with_the_package() -> None:
    """Nothing of the page is left out by git, and so by whoever builds from it."""
    ignored = subprocess.run(
        ["git", "check-ignore", *map(str, FOLDER.rglob("*.*"))], cwd=FOLDER, capture_output=True, text=True, check=False
    )
    assert [line for line in ignored.stdout.splitlines() if "__pycache__" not in line] == []
