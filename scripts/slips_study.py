"""How often a slip is named that is not there, and how often one that is: writes the tables of docs/facts.md.

Experiments are simulated from the law: clean ones over closures, observables and noises, and ones with a slip
or an effect at three sizes. Every fit is one by least squares with all its facts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from studies import DOCS, in_order, study_parser

SEED = 20
FACTS = DOCS / "facts.md"
BEGIN, END = "<!-- tables of scripts/slips_study.py -->", "<!-- end of the tables -->"
CLOSURES = ("ifr", "fr", "f", "ifr-contact")
E_N = {"e_n": 0.8}
EFFECTS = ("viscoelastic", "plasticity", "rolling")
UNITS = ("spins-doubled", "spins-halved", "spins-in-hertz", "spins-in-rpm")


@dataclass(frozen=True)
class Task:
    """Experiments of one scene and cause: `repeats` seeds from `first` on."""

    scene: object
    cause: object
    first: int
    repeats: int


def clean_scenes() -> list[object]:
    """Scenes without a slip: closures, observables, numbers of impacts, noise known and unknown."""
    from slips_scenes import Scene

    scenes = []
    for known in (True, False):
        for closure in CLOSURES:
            spins = closure in ("ifr", "f")
            scenes += [Scene(known=known, closure=closure, spins=spins, n=n) for n in (12, 60)]
            scenes += [
                Scene(("beta",), n, known=known, closure=closure, fixed=E_N, spins=closure == "fr")
                for n in (15, 60)
            ]
        scenes += [
            Scene(("beta_cm", "spin_y_after"), 20, known=known, fixed=E_N),
            Scene(("beta_cm",), 40, 0.02, known=known, fixed=E_N),
            Scene(("delta_deg", "e_n"), 30, known=known),
            Scene(("tan_psi_after", "e_n"), 30, known=known, ordered=False),
            Scene(("v_x", "v_n"), 30, 0.003, known=known, ordered=False),
            Scene(("delta_deg",), 25, known=known, fixed=E_N),
            Scene(n=40, known=known, spins=True, series=2),
            Scene(("beta",), 30, 0.03, known=known, fixed=E_N, series=2),
            Scene(n=40, known=known, ordered=False, repeats=2),
            Scene(("beta",), 40, 0.03, known=known, fixed=E_N, repeats=2),
            Scene(("beta",), 60, 0.03, known=known, fixed=E_N, repeats=6),
        ]
    return scenes


def powers() -> list[tuple[str, str, list[tuple[object, object, str]]]]:
    """Causes with what names them, and three cases of each: scene, cause, and words for the size."""
    from slips_scenes import Cause, Scene

    raw, spun = Scene(), Scene(spins=True)
    beta, centre, angle = (Scene(names, fixed=E_N) for names in (("beta",), ("beta_cm",), ("delta_deg",)))

    def sized(name: str, scene: Scene, sizes: Sequence[float], unit: str = "") -> tuple:
        return name, name, [(scene, Cause(name, size), f"{size:g}{unit}") for size in sizes]

    def unsized(cause: str, scene: Scene, named: str = "") -> tuple:
        cases = [(replace(scene, noise=s), Cause(cause), f"noise {s:g}") for s in (0.1, 0.03, 0.01)]
        return cause, named or cause, cases

    def in_b(title: str, name: str, cases: list) -> tuple:
        """The same in one of two series."""
        of_two = [(replace(s, series=2), replace(cause, in_b=True), size) for s, cause, size in cases]
        return f"{title}, in B", f"{name} in B", of_two

    found = [
        sized("angle-offset", raw, (0.5, 1.0, 2.0), " deg"),
        ("angle-offset", "angle-offset", sized("angle-offset", beta, (0.5, 1.0, 2.0), " deg")[2]),
        sized("camera-turn", raw, (0.25, 0.5, 1.0), " deg"),
        sized("speed-scale", raw, (0.01, 0.02, 0.05)),
        sized("spin-scale", raw, (0.02, 0.04, 0.08)),
        sized("inertia-factor", raw, (0.05, 0.1, 0.25)),
        sized("incoming-spin", raw, (0.02, 0.05, 0.1)),
        sized("incoming-roll", raw, (0.05, 0.1, 0.3)),
        sized("restitution-drift", replace(raw, ordered=False), (0.01, 0.02, 0.05)),
        unsized("sign-of-spin-y-before", spun),
        unsized("sign-of-spin-y-after", raw, "sign-of-spin-y-after spin_y_after"),
        unsized("sign-of-spins-y", spun, "sign-of-spins-y spin_y_after"),
        unsized("angle-from-wall", raw),
        unsized("angle-from-wall", beta),
        unsized("angle-in-radians", beta),
        unsized("sign beta", beta),
        unsized("sign delta_deg", angle),
        unsized("percent beta", beta),
        unsized("radians delta_deg", angle),
        unsized("meant-beta_cm beta", centre),
        unsized("meant-beta beta_cm", beta),
        unsized("zero-for-missing beta", beta),
    ]
    found += [unsized(f"{unit} spin_y_after", raw) for unit in UNITS]
    found += [
        unsized("size beta", beta),
        unsized("from-wall delta_deg", angle),
        unsized("exchanged v_x and v_n", raw),
    ]
    found += [
        in_b(*one)
        for one in (
            sized("angle-offset", raw, (1.0, 2.0, 4.0), " deg"),
            sized("camera-turn", raw, (0.5, 1.0, 2.0), " deg"),
            sized("inertia-factor", raw, (0.1, 0.25, 2.0 / 3.0)),
            unsized("sign-of-spins-y", spun, "sign-of-spins-y spin_y_after"),
            unsized("angle-from-wall", raw),
            unsized("sign beta", beta),
            unsized("spins-doubled spin_y_after", raw),
        )
    ]
    found += [sized(name, spun, (0.5, 1.0, 2.0)) for name in EFFECTS]
    found += [unsized("compliance", spun), unsized("compliance", beta)]
    copies = [(raw, Cause("duplicates", n), f"{n} of 60") for n in (1, 3, 10)]
    found += [("duplicates", "duplicates", copies)]
    for scene in (raw, beta):
        like = [(scene, Cause("correlated", r), f"{r:g}") for r in (0.5, 0.7, 0.9)]
        kinds = [(scene, Cause("two-kinds", x), f"mu {100 * x:.0f} %") for x in (0.2, 0.4, 0.8)]
        found += [("correlated errors", "independence", like), ("two kinds", "mixture", kinds)]
    return found


def called(scene: object, cause: object, seed: int) -> tuple[list[str], list[str]]:
    """What one fit names, slips before effects, and its other facts that fail."""
    from slips_scenes import experiment

    from ifrfit.inference.fit import fit
    from ifrfit.report.sentences import is_quiet

    data = experiment(scene, cause, seed)
    found = fit(data, method="lsq", independent=True, fix=scene.fixed, closure=scene.closure)
    facts = found.facts
    failing = [name for name, fact in facts.items() if not fact.ok and not is_quiet(name, fact)]
    # series that differ take the place of slips
    slips = facts["slips"].figures if "slips" in facts else {"called": ()}
    named = [*slips["called"], *slips.get("effects", ())]
    if "effects" in failing:
        named += facts["effects"].figures["called"]
    if "duplicates" in failing:
        named.insert(0, "duplicates")
    named += [name for name in ("independence", "mixture") if name in failing]
    return named, failing


def run(task: Task) -> list[tuple[list[str], list[str]]]:
    """All experiments of a task."""
    return [called(task.scene, task.cause, seed) for seed in range(task.first, task.first + task.repeats)]


def clean_table(repeats: int, seed: int, workers: int) -> list[str]:
    """False alarms of slips and of every other fact on clean data, as lines of Markdown."""
    from slips_scenes import Cause

    tasks = [Task(scene, Cause(), seed, repeats) for scene in clean_scenes()]
    fits = [one for task in in_order(run, tasks, workers) for one in task]
    slips = Counter(name for named, _ in fits for name in named)
    facts = Counter(name for _, failing in fits for name in failing)
    anything = sum(bool(failing) for _, failing in fits)
    lines = [f"{len(fits):,} clean fits: {len(tasks)} scenes, {repeats} seeds each.", ""]
    lines += ["| fact or slip | falsely named |", "|---|---|"]
    lines += [f"| fact `{name}` | {count} |" for name, count in sorted(facts.items())]
    lines += [f"| slip or effect {name} | {count} |" for name, count in sorted(slips.items())]
    return [*lines, f"| any fact | {anything} |"]


def power_table(repeats: int, seed: int, workers: int) -> list[str]:
    """How often each cause is named first, and named at all, as lines of Markdown."""
    cases = [
        (title, name, replace(scene, known=known), cause, size)
        for title, name, sizes in powers()
        for known in (True, False)
        for scene, cause, size in sizes
    ]
    tasks = [Task(scene, cause, seed, repeats) for _, _, scene, cause, _ in cases]
    lines = [f"Named first/named at all, of {repeats} experiments each.", ""]
    lines += ["| what is wrong | measured, sigma | small | middle | large |", "|---|---|---|---|---|"]
    cells: list[str] = []
    for (title, name, scene, _, size), fits in zip(cases, in_order(run, tasks, workers), strict=True):
        first = sum(named[:1] == [name] for named, _ in fits)
        cells.append(f"{size}: {first}/{sum(name in named for named, _ in fits)}")
        if len(cells) == 3:
            kind = f"{', '.join(scene.observables)}; {'known' if scene.known else 'unknown'}"
            lines.append(f"| {title} | {kind} | {' | '.join(cells)} |")
            cells = []
    return lines


def write(lines: Sequence[str], page: Path = FACTS) -> None:
    """Put the tables into the page, between their marks."""
    before, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    page.write_text("\n".join((f"{before}{BEGIN}", "", *lines, "", f"{END}{after}")), encoding="utf-8")


def main() -> None:
    """Run the study and write its tables."""
    parser = study_parser(__doc__, SEED)
    parser.add_argument("--clean", type=int, default=180, help="experiments of each clean scene")
    parser.add_argument("--power", type=int, default=20, help="experiments of each cause and size")
    asked = parser.parse_args()
    clean = clean_table(asked.clean, asked.seed, asked.workers)
    power = power_table(asked.power, asked.seed, asked.workers)
    write(["### False alarms", "", *clean, "", "### Power", "", *power])


if __name__ == "__main__":
    main()
