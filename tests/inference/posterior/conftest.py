from __future__ import annotations

import sys
from pathlib import Path

# the questions and the oracles are modules of their own, which write_reference.py imports too
sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))  # the package of hard cases
