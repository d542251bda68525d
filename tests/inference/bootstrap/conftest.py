from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[2]))  # the package of hard cases
sys.path.insert(0, str(Path(__file__).parents[3] / "scripts"))  # random problems
