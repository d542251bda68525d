from __future__ import annotations

import sys
from pathlib import Path

# the table of problems is a package of its own, which freeze.py imports too
sys.path.insert(0, str(Path(__file__).parents[1]))
