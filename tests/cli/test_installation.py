"""What `airrace doctor` examines."""

from airrace.cli.installation import examine


def test_every_component_is_listed_once() -> None:
    names = [component.name for component in examine()]
    assert {"numpy", "solver", "extensions"} <= set(names)
    assert len(names) == len(set(names))
