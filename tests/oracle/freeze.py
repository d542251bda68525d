"""Write `expected.json.gz`: the results of all problems, or of those named, as they are now.

    python tests/oracle/freeze.py [NAME ...]

prints what differs from what was frozen before, entry by entry. Whoever freezes anew says in the commit what
differs and why it should.
"""

from __future__ import annotations

import gzip
import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

from oracle.differences import differences
from oracle.problems import BY_NAME
from oracle.results import run

EXPECTED = Path(__file__).with_name("expected.json.gz")


def load() -> dict[str, Any]:
    """What is frozen, by problem; empty before the first time."""
    if not EXPECTED.exists():
        return {}
    return json.loads(gzip.decompress(EXPECTED.read_bytes()))


def freeze(names: list[str]) -> None:
    """Solve these problems, print what differs, and write the file."""
    former = load()
    frozen = {name: former[name] for name in BY_NAME if name in former}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            frozen[name] = run(BY_NAME[name], Path(folder))
        if name not in former:
            print(f"{name}: new")
        for difference in differences(frozen[name], former.get(name, frozen[name])):
            print(f"{name}: {difference}")
    for name in former.keys() - BY_NAME.keys():
        print(f"{name}: gone")
    text = json.dumps(frozen, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    EXPECTED.write_bytes(gzip.compress(text.encode(), mtime=0))


def main() -> None:
    """Freeze what the command line names."""
    names = sys.argv[1:] or list(BY_NAME)
    unknown = [name for name in names if name not in BY_NAME]
    if unknown:
        sys.exit(f"There is no problem {', '.join(unknown)}.")
    with tempfile.TemporaryDirectory() as none:
        os.environ["IFRFIT_DATA_DIR"] = none  # the bundled datasets, not what the user put in their place
        freeze(names)


if __name__ == "__main__":
    main()
