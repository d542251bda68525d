from __future__ import annotations

import sys
from pathlib import Path

# the targets are a module of their own, which worker processes import too
sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent.parent / "posterior"))
