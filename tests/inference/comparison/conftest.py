from __future__ import annotations

import sys
from pathlib import Path

# workers find the modules by it, too
sys.path.insert(0, str(Path(__file__).parents[3] / "scripts"))
sys.path.insert(0, str(Path(__file__).parent))
