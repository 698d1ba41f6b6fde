"""What all tests share: long files come first, slow tests run only when asked for, generated examples do not change."""

import os
import signal
from pathlib import Path

import disk_cache
import pytest
from hypothesis import settings

# Two libraries that each start a thread per core slow one another down; results do not depend on it.
os.environ.setdefault("OMP_NUM_THREADS", "1")

# A command in the background of a script ignores Ctrl-C, and all that it starts would, too. Tests send it.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

# A shared machine is no place for deadlines, and a test that fails must fail again.
settings.register_profile("steady", deadline=None, derandomize=True)
settings.load_profile("steady")

LONG = (
    "procedure/multistart/test_search.py",
    "runs/batch/test_handicap.py",
    "pages/report/test_in_browser.py",
    "runs/test_tampered_files.py",
    "runs/batch/test_cluster.py",
    "procedure/test_certified_races.py",
    "procedure/test_infeasible.py",
    "runs/batch/test_batch_command.py",
    "flights/safety/test_safety_document.py",
    "pages/report/test_page.py",
    "flights/logs/test_recorders.py",
    "end_to_end/test_finished_runs.py",
    "pages/views/test_course_figure.py",
    "end_to_end/test_untrusted_folders.py",
    "end_to_end/test_foreign_extensions.py",
    "design/test_killed_designer.py",
    "cli/test_inputs_unchanged.py",
    "test_doctests.py",
    "end_to_end/test_interrupted_runs.py",
    "documentation/test_site.py",
    "procedure/test_mesh_check.py",
    "procedure/multistart/test_lower_bound.py",
)
"""Files of 14 to 45 s, the longest first: in parallel no process waits for one of them at the end."""


def pytest_configure(config: pytest.Config) -> None:
    """Give all processes of this command one folder for what they compute."""
    if not hasattr(config, "workerinput"):
        disk_cache.open_folder()


def pytest_unconfigure(config: pytest.Config) -> None:
    """Remove it behind the last of them."""
    if not hasattr(config, "workerinput"):
        disk_cache.remove_folder()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Begin with long files; leave slow tests out unless `-m` chooses, they are named, or they are representative."""
    place = {Path(__file__).parent / name: number for number, name in enumerate(LONG)}
    items.sort(key=lambda item: place.get(item.path, len(LONG)))
    if config.option.markexpr or any("::" in argument for argument in config.args):
        return
    slow = [item for item in items if item.get_closest_marker("slow") and not item.get_closest_marker("representative")]
    config.hook.pytest_deselected(items=slow)
    left_out = set(slow)
    items[:] = [item for item in items if item not in left_out]
