"""Texts of strangers in cells of comma-separated values: no spreadsheet calculates them, no log obeys them."""

import re

_OBEYED = re.compile(r"^(?=[=+\-@\t\r]|\s*::)|(?<=\n)(?=\s*::)")
"""Places before what a spreadsheet takes for a formula, and before what a runner of workflows takes for a command."""


def text_cell(text: str) -> str:
    """Return a text as it may stand in a cell; one that is no number and would be obeyed begins with an apostrophe.

    A spreadsheet shows such a cell as text: https://owasp.org/www-community/attacks/CSV_Injection.
    """
    return text if len(text) < 2 or _is_number(text) else _OBEYED.sub("'", text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
