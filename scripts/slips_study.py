"""How often a slip is named that is not there, and how often one that is: writes the tables of docs/facts.md.

Experiments are simulated from the law: clean ones drawn over closures, observables, series and policies of
the noise, and ones with a slip, an effect or a gross outlier at three sizes. Every fit is one by least
squares with all its facts.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from studies import DOCS, in_order, study_parser

SEED = 20
FACTS = DOCS / "facts.md"
BEGIN, END = "<!-- tables of scripts/slips_study.py -->", "<!-- end of the tables -->"
E_N = {"e_n": 0.8}
EFFECTS = ("viscoelastic", "plasticity", "rolling")
# true of few rows, whatever their errors: held against the table without errors
BY_DESIGN = ("identifiable", "noise_dof", "noise_modes", "global_optimum")
OF_SEARCH = ("converged", "global_optimum")  # say how far the search came, and nothing of the data
COARSER = 2.0  # times sigma at which a design still determines its constants, for a finding to be false
BOUND = 0.95
SAME = 1e-3  # by which constants of a table without errors may miss those that made it
KINDS: dict[str, Callable[[object], str]] = {
    "closure": lambda scene: scene.closure,
    "noise": lambda scene: scene.policy,
    "series": lambda scene: str(scene.series),
    "impacts": lambda scene: "8 to 19" if scene.n < 20 else "20 to 49" if scene.n < 50 else "50 and more",
    "e_n": lambda scene: "fixed" if scene.fixed else "with a prior" if scene.prior else "free",
}
UNITS = ("spins-doubled", "spins-halved", "spins-in-hertz", "spins-in-rpm")


@dataclass(frozen=True)
class Task:
    """Experiments of one scene and cause: `repeats` seeds from `first` on."""

    scene: object
    cause: object
    first: int
    repeats: int


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
        sized("angle-scale", raw, (0.01, 0.02, 0.05)),
        ("angle-scale", "angle-scale", sized("angle-scale", beta, (0.02, 0.05, 0.1))[2]),
        sized("rebound-zero", Scene(("delta_deg", "e_n")), (0.5, 1.0, 2.0), " deg"),
        sized("rebound-scale", Scene(("delta_deg", "e_n")), (0.02, 0.05, 0.1)),
        sized("angles-scale", Scene(("delta_deg", "e_n")), (0.02, 0.05, 0.1)),
        sized("camera-turn", raw, (0.25, 0.5, 1.0), " deg"),
        sized("speed-scale", raw, (0.01, 0.02, 0.05)),
        sized("contact-scale", beta, (0.02, 0.06, 0.1)),
        sized("scale-along-wall", raw, (0.01, 0.02, 0.05)),
        sized("spin-scale", raw, (0.02, 0.04, 0.08)),
        *(sized(name, raw, (0.01, 0.02, 0.05), " m/s") for name in ("zero-along", "zero-across")),
        *(sized(f"zero-{way}-after", raw, (0.02, 0.04, 0.08), " m/s") for way in ("along", "across")),
        sized("fall-between", raw, (0.02, 0.05, 0.1), " m/s"),
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
        unsized("angle-in-gon", beta),
        unsized("angle-in-gon", Scene(("beta_cm", "e_n"))),
        unsized("sign beta", beta),
        unsized("sign delta_deg", angle),
        unsized("percent beta", beta),
        unsized("radians delta_deg", angle),
        unsized("meant-beta_cm beta", centre),
        unsized("meant-beta beta_cm", beta),
        unsized("zero-for-missing beta", beta),
        unsized("size-of-spin-y-before", spun),
        unsized("mixed-sign-of-spin-y-before", spun),
        unsized("mixed-squared e_n", Scene(("beta", "e_n"), fixed={})),
        unsized("sorted beta", replace(beta, ordered=False)),
        unsized("shifted-down beta", replace(beta, ordered=False)),
        unsized("unrelated beta", beta, "unrelated_readings"),
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
    for scene in (raw, beta, replace(beta, n=15)):
        gross = [(scene, Cause("outlier", size), f"{size:g} sigma") for size in (4.0, 5.0, 7.0)]
        found += [(f"an outlier among {scene.n}", "outliers", gross)]
    for noise in (0.003, 0.01, 0.03):
        for scene in (raw, beta):
            cases = [
                (replace(scene, noise=noise), Cause("angle-scatter", size), f"{size:g} deg")
                for size in (0.5, 1.0, 1.5)
            ]
            found += [(f"errors of the angles, noise {noise:g}", "angle_scatter", cases)]
    for scene in (raw, beta):
        like = [(scene, Cause("correlated", r), f"{r:g}") for r in (0.5, 0.7, 0.9)]
        kinds = [(scene, Cause("two-kinds", x), f"mu {100 * x:.0f} %") for x in (0.2, 0.4, 0.8)]
        found += [("correlated errors", "independence", like), ("two kinds", "mixture", kinds)]
        uneven = [(scene, Cause("scatter-by-angle", x), f"by {x:g}") for x in (3.0, 6.0, 12.0)]
        found += [("noise that grows from 0 to 90 deg", "scatter_by_angle", uneven)]
    return found


def fitted(scene: object, cause: object, seed: int, prior: Mapping[str, object] | None = None) -> object:
    """An experiment, fitted as its scene says, or with another prior."""
    from slips_scenes import experiment

    from ifrfit.inference.fit import fit

    return fit(
        experiment(scene, cause, seed),
        method="lsq",
        independent=True,
        closure=scene.closure,
        fix=scene.fixed,
        prior=scene.prior if prior is None else prior,
        separate=scene.separate,
        noise=scene.policy,
    )


def called(scene: object, cause: object, seed: int) -> tuple[list[str], list[str]]:
    """What one fit names, slips before effects, and its other facts that fail."""
    from ifrfit.inference.result.types import is_quiet

    facts = fitted(scene, cause, seed).facts
    failing = [name for name, fact in facts.items() if not fact.ok and not is_quiet(name, fact)]
    # series that differ take the place of slips
    slips = facts["slips"].figures if "slips" in facts else {"called": ()}
    named = [*slips["called"], *slips.get("effects", ())]
    if "effects" in failing:
        named += facts["effects"].figures["called"]
    if "duplicates" in failing:
        named.insert(0, "duplicates")
    if "angle_scatter" in failing:
        named.insert(0, "angle_scatter")
    named += [
        name
        for name in ("unrelated_readings", "independence", "mixture", "scatter_by_angle", "outliers")
        if name in failing
    ]
    return named, failing


def run(task: Task) -> list[tuple[list[str], list[str]]]:
    """All experiments of a task."""
    return [called(task.scene, task.cause, seed) for seed in range(task.first, task.first + task.repeats)]


@dataclass(frozen=True)
class Clean:
    """A clean fit.

    Attributes
    ----------
    scene : Scene
    named : list of str
        Slips, effects and other reasons that it names.
    failing : list of str
        Facts that fail and are no note.
    by_design : list of str
        Those of them that the table without errors shows as well.
    """

    scene: object
    named: list[str]
    failing: list[str]
    by_design: list[str]

    @property
    def false(self) -> list[str]:
        """Facts that say something of the data which is not so."""
        return [name for name in self.failing if name not in (*self.by_design, *OF_SEARCH)]


def clean_fit(task: tuple[int, int]) -> Clean:
    """Fit a clean table of a seed and number."""
    from clean_scenes import clean_scene
    from slips_scenes import Cause

    seed, number = task
    scene = clean_scene(seed, number)
    named, failing = called(scene, Cause(), number)
    open_ones = [name for name in failing if name in BY_DESIGN]
    by_design = open_ones if open_ones and not determines(scene, number) else []
    return Clean(scene, named, failing, by_design)


def determines(scene: object, seed: int) -> bool:
    """Whether a design tells its constants: its table without errors does, at twice the sigma that it has.

    It does not either where a constant is not told from a bound of its domain, or where the best constants of
    that table are not those that made it. A prior lies about the truth.
    """
    from slips_scenes import Cause, truth

    made = truth(scene, seed)
    prior = {name: (made[name], sd) for name, (_, sd) in scene.prior.items()}
    coarse = replace(scene, policy="known", noise=COARSER * scene.noise)
    found = fitted(coarse, Cause("no-errors"), seed, prior=prior)
    return all(
        one.status in ("fixed", "prior", "determined")
        and abs(one.value - made[name.partition("[")[0]]) < SAME
        for name, one in found.flat_constants().items()
    )


def clean_table(fits: Sequence[Clean]) -> list[str]:
    """False alarms of every fact on clean data, alone and together, as lines of Markdown."""
    false = Counter(name for one in fits for name in one.false)
    designs = Counter(name for one in fits for name in one.by_design)
    search = Counter(name for one in fits for name in set(one.failing) - set(one.by_design) & set(OF_SEARCH))
    named = Counter(name for one in fits for name in one.named if name not in one.failing)
    lines = [f"{len(fits):,} clean fits, each of a scene of its own.", ""]
    lines += ["| fact, slip or effect | falsely named |", "|---|---|"]
    lines += [f"| fact `{name}` | {n} |" for name, n in sorted(false.items())]
    lines += [f"| slip or effect {name} | {n} |" for name, n in sorted(named.items())]
    lines += [f"| **any fact** | **{_share(fits)}** |", ""]
    lines += [f"By design, no false alarms: {_counted(designs)}. Of the search: {_counted(search)}.", ""]
    lines += ["| over | any fact falsely |", "|---|---|"]
    for title, of in KINDS.items():
        groups: dict[str, list[Clean]] = {}
        for one in fits:
            groups.setdefault(of(one.scene), []).append(one)
        lines += [f"| {title} {key} | {_share(own)} |" for key, own in sorted(groups.items())]
    return lines


def _counted(names: Counter[str]) -> str:
    return ", ".join(f"`{name}` {n}" for name, n in sorted(names.items())) or "none"


def _share(fits: Sequence[Clean]) -> str:
    """Fits with a false alarm, and the one-sided bound of their share."""
    from scipy.special import betaincinv

    n, false = len(fits), sum(bool(one.false) for one in fits)
    bound = betaincinv(false + 1.0, n - false, BOUND) if false < n else 1.0
    return f"{false} of {n:,}: at most {100.0 * bound:.2g} %"


def power_table(repeats: int, seed: int, workers: int) -> list[str]:
    """How often each cause is named first, and named at all, as lines of Markdown."""
    cases = [
        (title, name, replace(scene, policy=policy), cause, size)
        for title, name, sizes in powers()
        for policy in ("known", "unknown")
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
            kind = f"{', '.join(scene.observables)}; {scene.policy}"
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
    parser.add_argument("--clean", type=int, default=4000, help="clean experiments")
    parser.add_argument("--power", type=int, default=20, help="experiments of each cause and size")
    asked = parser.parse_args()
    tasks = [(asked.seed, number) for number in range(asked.clean)]
    clean = clean_table(list(in_order(clean_fit, tasks, asked.workers)))
    power = power_table(asked.power, asked.seed, asked.workers)
    write(["### False alarms", "", *clean, "", "### Power", "", *power])


if __name__ == "__main__":
    main()
