"""The studies are scripts that find each other in their folder; so do their tests."""

import sys
from pathlib import Path

STUDIES = Path(__file__).parents[3] / "benchmarks" / "paper"
sys.path.append(str(STUDIES))
