"""The aircraft that JSBSim flies stands beside the script that compares the two."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[2] / "scripts"))
