"""The tools are scripts that find each other in their folder; so do their tests."""

import sys
from pathlib import Path

TOOLS = Path(__file__).parents[3] / "tools" / "flow"
sys.path.append(str(TOOLS))
