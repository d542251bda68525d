"""Write `expected.json.gz`: the results of all problems, or of those named, as they are now.

    python tests/oracle/freeze.py [--check] [NAME ...]

prints what differs by more than 1e-9 from what was frozen before, entry by entry, also where the test allows
more. With --check nothing is written. Whoever freezes anew says in the commit what differs and why it should.
"""

from __future__ import annotations

import argparse
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


def freeze(names: list[str], check: bool) -> None:
    """Solve these problems, print what differs, and write the file unless that is only to be checked."""
    former = load()
    frozen = {name: former[name] for name in BY_NAME if name in former}
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            frozen[name] = run(BY_NAME[name], Path(folder))
        if name not in former:
            sys.stdout.write(f"{name}: new\n")
        for difference in differences(frozen[name], former.get(name, frozen[name])):
            sys.stdout.write(f"{name}: {difference}\n")
    for name in former.keys() - BY_NAME.keys():
        sys.stdout.write(f"{name}: gone\n")
    if check:
        return
    text = json.dumps(frozen, sort_keys=True, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    EXPECTED.write_bytes(gzip.compress(text.encode(), mtime=0))


def main() -> None:
    """Freeze what the command line names."""
    parser = argparse.ArgumentParser(description="Freeze the results of problems as they are now.")
    parser.add_argument("names", nargs="*", metavar="NAME", help="problems; all by default")
    parser.add_argument("--check", action="store_true", help="print what differs, write nothing")
    asked = parser.parse_args()
    unknown = [name for name in asked.names if name not in BY_NAME]
    if unknown:
        sys.exit(f"There is no problem {', '.join(unknown)}.")
    with tempfile.TemporaryDirectory() as none:
        os.environ["IFRFIT_DATA_DIR"] = none  # the bundled datasets, not what the user put in their place
        freeze(asked.names or list(BY_NAME), asked.check)


if __name__ == "__main__":
    main()
