"""Suggestions for names that are not known."""

import difflib
from collections.abc import Collection

NAMES_TOLD = 20
"""The largest number of names that are listed where none is similar."""
COMPARISONS_MAX = 50_000
"""The largest number of comparisons of names for one document, about a second's work."""


class Speller:
    """A search for the name that was meant; on a document with thousands of names it gives up after a while."""

    def __init__(self) -> None:
        self._comparisons = 0

    def suggestion(self, word: str, known: Collection[str]) -> str:
        """Return `; did you mean ...?`, or the choices where nothing is similar; empty once it has given up."""
        self._comparisons += len(known)
        if self._comparisons > COMPARISONS_MAX:
            return ""
        similar = difflib.get_close_matches(word[:100], known, n=1)
        return f"; did you mean `{similar[0]}`?" if similar else choices(known)


def choices(known: Collection[str]) -> str:
    """Return `; known here: a, b`; empty where nothing is known."""
    if not known:
        return ""
    told = list(known)[:NAMES_TOLD]
    more = f" and {len(known) - len(told)} more" if len(known) > len(told) else ""
    return f"; known here: {', '.join(told)}{more}"
