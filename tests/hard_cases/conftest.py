from __future__ import annotations

import sys
from pathlib import Path

# the table is a package of its own, which scripts/write_hard_cases.py imports too
sys.path.insert(0, str(Path(__file__).parents[1]))
