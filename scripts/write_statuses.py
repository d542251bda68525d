"""Write docs/statuses.md from the package's own table of rules."""

from __future__ import annotations

from studies import DOCS, markdown

from ifrfit.inference.diagnostics.thresholds import FACTS, STATUSES

_STRICT = """## What `--strict` insists on

`ifrfit fit --strict` delivers its result and leaves with exit status 4, the reasons on standard error,
where a constant that was asked for is `not_determined`, or where a fact fails: those of lines with LOOK.
Facts of notes do not count: `at_bound`, which the status of the constant tells, `global_optimum` where only
its proof is missing and no second optimum was found, and facts that the data were too few for. Of facts
that fail for one reason the one that tells it is enough: `predictive` beside the misfit that explains it,
`lack_of_fit` where series differ or outliers are all of it. `ifrfit compare --strict` insists on what it
says with LOOK: every evidence converged, and the leading closure describes the data."""


def page() -> str:
    """The page's text."""
    written = "Written by `scripts/write_statuses.py` from the rules in the code."
    lines = ["# Statuses and facts", "", written, ""]
    for title, rules in (("status of a constant", STATUSES), ("fact of a fit", FACTS)):
        lines += [markdown((title, "rule"), [(f"`{name}`", rule) for name, rule in rules.items()]), ""]
    return "\n".join([*lines, _STRICT, ""])


if __name__ == "__main__":
    (DOCS / "statuses.md").write_text(page(), encoding="utf-8")
