"""Presets: the rules of a season by name, in files that come with the package and are read as strictly as any other."""

import difflib
from collections.abc import Collection
from functools import cache
from importlib import resources
from typing import TypeVar

from pydantic import BaseModel

from airrace.errors import Finding, InputError
from airrace.inputs.kinds.defaults import GateDefaultsEntry
from airrace.inputs.nodes import MappingNode, Reporter
from airrace.inputs.rules_schema import LimitsEntry, PresetEntry, RulesEntry
from airrace.inputs.validation import validate
from airrace.inputs.yaml_reader import read_yaml

FOLDER = resources.files("airrace.inputs") / "presets"
SUFFIX = ".yaml"

Keys = TypeVar("Keys", bound=BaseModel)


@cache
def preset_names() -> tuple[str, ...]:
    """Return the names of all presets, in alphabetical order."""
    return tuple(sorted(file.name.removesuffix(SUFFIX) for file in FOLDER.iterdir() if file.name.endswith(SUFFIX)))


@cache
def read_preset(name: str) -> PresetEntry:
    """Read a preset that exists.

    Raises:
        InputError: its file is not what it should be.
    """
    file = FOLDER / f"{name}{SUFFIX}"
    findings: list[Finding] = []
    root = read_yaml(file.name, file.read_text(encoding="utf-8"))
    preset = validate(PresetEntry, Reporter(root, findings)) if isinstance(root, MappingNode) else None
    if preset is None:
        raise InputError(findings)
    return preset


def with_preset(
    rules: RulesEntry, gate_defaults: GateDefaultsEntry, reporter: Reporter
) -> tuple[LimitsEntry, GateDefaultsEntry]:
    """Return the rules and gate defaults of a file on top of those of the preset it names."""
    if rules.preset is None:
        return rules, gate_defaults
    names = preset_names()
    if rules.preset not in names:
        reporter.value(("rules", "preset"), f"unknown preset `{rules.preset}`{_near(rules.preset, names)}")
        return rules, gate_defaults
    preset = read_preset(rules.preset)
    return _overlaid(preset.rules, rules), _overlaid(preset.gate_defaults, gate_defaults)


def _overlaid(below: Keys, above: BaseModel) -> Keys:
    """Return the keys of `below`, except those that `above` gives itself."""
    own = {key: getattr(above, key) for key in above.model_fields_set if key in type(below).model_fields}
    return below.model_copy(update=own)


def _near(word: str, names: Collection[str]) -> str:
    """Return the most similar name, and all names: seasons are too alike to leave it at one."""
    similar = difflib.get_close_matches(word[:100], names, n=1)
    meant = f" did you mean `{similar[0]}`?" if similar else ""
    return f";{meant} known are {', '.join(names)}"
