"""The pictures are scripts that find each other in their folder; so do their tests."""

import sys
from pathlib import Path

STYLES = Path(__file__).parents[3] / "benchmarks" / "styles"
sys.path.append(str(STYLES))
