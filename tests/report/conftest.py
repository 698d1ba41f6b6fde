"""The flights of `tests/flights/flown.py` serve the tests of reports as well."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "flights"))
