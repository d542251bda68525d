"""Posterior by composite Gauss-Legendre quadrature over (e_n, c, t), by brute force and in numpy alone.

Nothing is shared with the package. The third coordinate is t = kappa/b(c), the slip ratio at which sticking
ends, so that the kinks of every row lie on planes t = tau and no panel contains one. Where mu is shared by
series of separate e_n, the third coordinate is mu itself, and the panels are merely fine.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any

import numpy as np
from posterior_questions import LEVELS, Array, Question, Row
from scipy import optimize, special

_DEEP = -60.0  # log of the share of the posterior that may lie outside the box


@cache
def rule(order: int) -> tuple[Array, Array, Array]:
    """Gauss-Legendre nodes and weights, and the Legendre polynomials below that order at the nodes."""
    x, w = np.polynomial.legendre.leggauss(order)
    legendre = np.array([special.eval_legendre(n, x) for n in range(order)])
    return x, w, legendre


@dataclass(frozen=True)
class Axis:
    """Nodes and weights of equal rules on panels."""

    edges: Array
    order: int

    @cached_property
    def nodes(self) -> Array:
        x, _, _ = rule(self.order)
        half = 0.5 * np.diff(self.edges)[:, None]
        return (self.edges[:-1, None] + half * (1.0 + x)).ravel()

    @cached_property
    def weights(self) -> Array:
        _, w, _ = rule(self.order)
        return (0.5 * np.diff(self.edges)[:, None] * w).ravel()

    def until(self, x: Array) -> tuple[Array, Array, Array]:
        """For each x: its panel, weights that integrate from the panel's start to x, the first node."""
        panel = np.clip(np.searchsorted(self.edges, x, side="right") - 1, 0, self.edges.size - 2)
        low, high = self.edges[panel], self.edges[panel + 1]
        u = np.clip(2.0 * (x - low) / (high - low) - 1.0, -1.0, 1.0)
        _, w, legendre = rule(self.order)
        at_u = [special.eval_legendre(n, u) for n in range(self.order + 1)]
        # the integrals of (2 n + 1) P_n from -1 to u
        reach = np.stack([u + 1.0, *(at_u[n + 1] - at_u[n - 1] for n in range(1, self.order))], axis=-1)
        inside = reach @ legendre
        return panel, 0.5 * w * inside * 0.5 * (high - low)[..., None], panel * self.order


def split(edges: Sequence[float], low: float, high: float, pieces: int, order: int) -> Axis:
    """Panels between `low` and `high` that break at `edges` and are no wider than 1/pieces of the whole."""
    breaks = np.unique(np.concatenate([[low, high], [x for x in edges if low < x < high]]))
    widest = (high - low) / pieces
    parts = [
        np.linspace(a, b, max(1, math.ceil((b - a) / widest)) + 1)[:-1] for a, b in itertools.pairwise(breaks)
    ]
    return Axis(np.append(np.concatenate(parts), high), order)


def observe(row: Row, j: float, k: Any, e_n: Any, mu: Any) -> Any:
    """Value of one observation, from the impulse factor k."""
    share = j / (1.0 + j)
    sine, cosine = math.sin(math.radians(row.gamma)), math.cos(math.radians(row.gamma))
    slip_x, slip_y = sine + row.spin_y, row.spin_x
    v_x, v_y, v_n = sine - k * slip_x, -k * slip_y, e_n * cosine
    contact = slip_x * (1.0 - k / share)
    name = row.observable
    if name in ("e_n", "v_n"):
        return e_n if name == "e_n" else v_n
    if name == "mu":
        return mu
    if name == "beta":
        return k / share - 1.0
    if name == "beta_cm":
        return -v_x / sine
    if name == "beta_tot":
        return np.sqrt(v_x**2 + v_y**2 + v_n**2)
    if name == "mu_app":
        return k * slip_x / ((1.0 + e_n) * cosine)
    if name == "delta_deg":
        return np.degrees(np.arctan2(v_x, v_n))
    if name == "lambda_deg":
        return np.degrees(np.arctan2(v_y, v_x))
    if name == "tan_psi_after":
        return contact / cosine
    if name == "tan_psi_out":
        return contact / v_n
    if name == "psi_after_deg":
        return np.degrees(np.arctan2(contact, cosine))
    if name == "psi_out_deg":
        return np.degrees(np.arctan2(contact, v_n))
    if name == "spin_y_after":
        return row.spin_y - k * slip_x / j
    if name == "spin_x_after":
        return row.spin_x - k * slip_y / j
    return {"v_x": v_x, "v_y": v_y}[name]


def tau_of(row: Row) -> float:
    """|U_t|/U_n."""
    sine, cosine = math.sin(math.radians(row.gamma)), math.cos(math.radians(row.gamma))
    return math.hypot(sine + row.spin_y, row.spin_x) / cosine


@dataclass(frozen=True)
class Noise:
    """One group of rows that share a sigma, or a factor on their sigmas."""

    name: str  # empty: sigma is known
    rows: tuple[Row, ...]
    low: float = 1.0
    high: float = 1.0

    def constant(self) -> float:
        """Log of what does not depend on the misfit, less the share of sigma that is integrated out."""
        sigmas = [1.0 if row.sigma is None or self.absolute else row.sigma for row in self.rows]
        return -0.5 * len(self.rows) * math.log(2.0 * math.pi) - sum(math.log(s) for s in sigmas)

    @property
    def absolute(self) -> bool:
        """Whether sigma itself is sought (unknown) rather than a factor (scaled) or nothing (known)."""
        return self.name not in ("", "noise")

    def weight(self, row: Row) -> float:
        """1/sigma^2 of a row, at unit noise."""
        return 1.0 if self.absolute or row.sigma is None else row.sigma**-2

    def log_moment(self, misfit: Array, power: int, low: float, high: float) -> Array:
        """Log of the integral of sigma^(power - 1 - n) exp(-misfit/(2 sigma^2)) from low to high."""
        n = 0.5 * (len(self.rows) - power)
        half = np.maximum(0.5 * misfit, 1e-300)
        if n <= 0.0:
            raise ValueError("too few rows for this moment")
        share = special.gammaincc(n, half / high**2) - special.gammaincc(n, half / low**2)
        other = special.gammainc(n, half / low**2) - special.gammainc(n, half / high**2)
        best = np.where(half / low**2 > n, other, share)  # whichever does not cancel
        best = np.where(half / high**2 > n, share, best)
        with np.errstate(divide="ignore"):
            return np.asarray(
                math.log(0.5) + special.gammaln(n) - n * np.log(half) + np.log(np.maximum(best, 0.0))
            )

    def log_likelihood(self, misfit: Array) -> Array:
        if not self.name:
            return self.constant() - 0.5 * misfit
        scale = math.log(math.log(self.high / self.low))
        return self.constant() - scale + self.log_moment(misfit, 0, self.low, self.high)


def noises(question: Question) -> tuple[Noise, ...]:
    """Groups of rows, by the policy."""
    if question.noise == "known":
        return (Noise("", question.rows),)
    if question.noise == "scaled":
        return (Noise("noise", question.rows, *question.noise_bounds[""]),)
    keys = dict.fromkeys((row.series, row.observable) for row in question.rows)
    return tuple(
        Noise(
            f"noise[{s}/{o}]",
            tuple(row for row in question.rows if (row.series, row.observable) == (s, o)),
            *question.noise_bounds[f"{s}/{o}"],
        )
        for s, o in keys
    )


@dataclass
class Dense:
    """The posterior of one question on one grid.

    Attributes
    ----------
    pieces, order : int
        Panels on the range of each coordinate, and nodes of a panel.
    """

    question: Question
    pieces: tuple[int, int, int] = (10, 10, 16)
    order: int = 8
    by_mu: bool = False
    axes: dict[str, tuple[Axis | None, Axis | None, Axis]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        q = self.question
        self.separate = (
            "e_n" in q.separate, bool(q.own) and q.own in q.separate, "mu" in q.separate
        )  # fmt: skip
        self.by_mu = self.by_mu or (self.separate[0] and not self.separate[2]) or "mu" in q.fix
        self.groups = noises(q)
        self._boxes()
        self._integrate()

    # --- where the mass is

    def _boxes(self) -> None:
        q = self.question
        e, c, mu = (self._range(n) for n in ("e_n", q.own or "none", "mu"))
        if self.by_mu:
            third = (mu[0], mu[1])
        else:
            b = [q.linear()[2] + q.linear()[3] * x for x in c]
            most = mu[1] * (1.0 + e[1]) / max(min(b), 1e-3 * max(b))
            third = (mu[0] * (1.0 + e[0]) / max(b), most)
        whole = [e, c, third]
        self.box = {s: [tuple(x) for x in whole] for s in q.series}
        for turn in range(20):
            n = 15 if turn < 4 else 11
            self._grid((n, n, 4 * n if turn == 0 else 2 * n), 2, geometric=turn == 0)
            self._integrate()
            allowance = max(-_DEEP, 1000.0 / 2.0**turn)
            if not self._zoom(allowance) and allowance == -_DEEP:
                break
        for _ in range(3):
            self._grid((16, 16, 32), 4, grades=self._grades())
            self._integrate()
        self._grid(self.pieces, self.order, grades=self._grades())

    def _grades(self) -> dict[str, list[Any]]:
        """Where panels should lie: closer where there is more, and nowhere far apart."""
        found: dict[str, list[Any]] = {}
        for s in self.question.series:
            mass, found[s] = self.joint(s), []
            for at, axis in enumerate(self.axes[s]):
                if axis is None:
                    found[s].append(None)
                    continue
                share = (
                    mass.sum(axis=tuple(x for x in range(3) if x != at)).reshape(-1, axis.order).sum(axis=1)
                )
                density = share / np.diff(axis.edges)
                grade = ((density / density.max()) ** 0.25 + 0.03) * np.diff(axis.edges)
                found[s].append((np.append(0.0, np.cumsum(grade)) / grade.sum(), axis.edges))
        if found:
            for at in range(3):
                if not self.separate[at]:
                    for s in found:
                        found[s][at] = found[self.question.series[0]][at]
        return found

    def _range(self, name: str) -> tuple[float, float]:
        if name == "none":
            return 0.0, 0.0
        if name in self.question.fix:
            return (self.question.fix[name],) * 2
        return self.question.domain(name)

    def _grid(
        self, pieces: tuple[int, int, int], order: int, *, geometric: bool = False, grades: Any = None
    ) -> None:
        for s in self.question.series:
            rows = [r for r in self.question.rows if self.separate[2] is False or r.series == s]
            kinks = [] if self.by_mu else [tau_of(r) for r in rows]
            made: list[Axis | None] = []
            for (low, high), n, breaks in zip(self.box[s], pieces, ([], [], kinks), strict=True):
                if low == high:
                    made.append(None)
                elif grades is not None:
                    even = np.interp(np.linspace(0.0, 1.0, n + 1), *grades[s][len(made)])
                    inner = [x for x in breaks if low < x < high]
                    made.append(Axis(np.unique(np.concatenate([even, inner])), order))
                elif geometric and breaks:
                    top = min(max(breaks) * 1.5, high)
                    far = np.geomspace(top, high, 12)[1:] if top < high else np.array([])
                    near = split(breaks, low, top, n, order).edges
                    made.append(Axis(np.append(near, far), order))
                else:
                    made.append(split(breaks, low, high, n, order))
            self.axes[s] = tuple(made)  # type: ignore[assignment]

    def _zoom(self, allowance: float) -> bool:
        """Narrow every range to where the log posterior is within the allowance; whether it narrowed much."""
        narrowed = False
        for s in self.question.series:
            log = self.joint_log(s)
            near = log > log.max() - allowance
            for at, axis in enumerate(self.axes[s]):
                if axis is None:
                    continue
                hit = np.flatnonzero(near.any(axis=tuple(x for x in range(3) if x != at)))
                edges, panel = axis.edges, hit // axis.order
                low, high = edges[max(panel[0] - 1, 0)], edges[min(panel[-1] + 2, edges.size - 1)]
                old = self.box[s][at]
                narrowed |= high - low < 0.85 * (old[1] - old[0])
                self.box[s][at] = (low, high)
        for at in range(3):  # what is shared has one range
            if not self.separate[at]:
                ends = [self.box[s][at] for s in self.question.series]
                both = (min(x[0] for x in ends), max(x[1] for x in ends))
                for s in self.question.series:
                    self.box[s][at] = both
        return bool(narrowed)

    # --- the integral

    def _values(self, s: str) -> tuple[Array, Array, Array]:
        """e_n, c and the third coordinate, broadcasting to the grid."""
        found = []
        for at, (axis, (low, _)) in enumerate(zip(self.axes[s], self.box[s], strict=True)):
            nodes = np.array([low]) if axis is None else axis.nodes
            found.append(nodes.reshape([-1 if x == at else 1 for x in range(3)]))
        return tuple(found)  # type: ignore[return-value]

    def _weights(self, s: str, at: int) -> Array:
        axis = self.axes[s][at]
        return (np.ones(1) if axis is None else axis.weights).reshape(
            [-1 if x == at else 1 for x in range(3)]
        )

    def constants_at(self, s: str) -> tuple[Array, Array, Array, Array]:
        """e_n, c, mu and b on the grid."""
        _, _, b0, b1 = self.question.linear()
        e, c, third = self._values(s)
        b = b0 + b1 * c if b1 else np.full((1, 1, 1), b0)  # a constant b brings no direction of its own
        return e, c, (third if self.by_mu else third * b / (1.0 + e)), b

    def _misfits(self, s: str) -> list[Array]:
        q = self.question
        a0, a1, _, _ = q.linear()
        e, c, mu, b = self.constants_at(s)
        _, _, third = self._values(s)
        found = []
        for group in self.groups:
            total: Any = np.zeros(np.broadcast_shapes(e.shape, c.shape, third.shape))
            for row in group.rows:
                if row.series != s:
                    continue
                tau = tau_of(row)
                ratio = mu * (1.0 + e) / b if self.by_mu else third
                with np.errstate(divide="ignore"):
                    k = a0 + a1 * c + b * np.minimum(1.0, ratio / tau if tau > 0.0 else np.inf)
                total = (
                    total + group.weight(row) * (row.value - observe(row, q.inertia_factor, k, e, mu)) ** 2
                )
            found.append(total)
        return found

    def _log_prior(self, s: str, at: int) -> Any:
        """Log of the normalised prior density of one constant, on the grid."""
        q = self.question
        name = ("e_n", q.own, "mu")[at]
        if not name or name in q.fix:
            return 0.0
        value = self.constants_at(s)[at]
        low, high = q.domain(name)
        if name in q.prior:
            mean, sd = q.prior[name]
            mass = special.ndtr((high - mean) / sd) - special.ndtr((low - mean) / sd)
            density = -0.5 * ((value - mean) / sd) ** 2 - math.log(sd * math.sqrt(2.0 * math.pi) * mass)
        else:
            density = np.full_like(value, -math.log(high - low))
        hair = 1e-13 * max(1.0, abs(high))
        return np.where((value >= low - hair) & (value <= high + hair), density, -np.inf)

    def _measure(self, s: str, at: int) -> Any:
        """Log of weight, prior and Jacobian that belong to one coordinate."""
        with np.errstate(divide="ignore"):
            out = np.log(self._weights(s, at)) + self._log_prior(s, at)
        if at == 2 and not self.by_mu and "mu" not in self.question.fix:
            e, _, _, b = self.constants_at(s)
            if b.size > 1 and self.separate[1]:
                raise ValueError("t is not shared where b is not")
            out = out + np.log(b) - np.log1p(e)
        return out

    def _integrate(self) -> None:
        """Log of the mass in each cell: per series, and of what they share."""
        series = self.question.series
        if self.question.noise == "scaled" and len(series) > 1 and any(self.separate):
            raise ValueError("a common factor does not separate by series")
        coupled = not any(self.separate)
        self.misfits = {s: self._misfits(s) for s in series}
        first = series[0]
        if coupled:
            # all series on one grid: misfits add within a group
            total = [sum(self.misfits[s][g] for s in series) for g in range(len(self.groups))]
            log = sum(group.log_likelihood(x) for group, x in zip(self.groups, total, strict=True))
            self.totals = total
            self.own_log = {first: log + 0.0}
            self.reduced = {first: log + 0.0}
        else:
            self.own_log, self.reduced = {}, {}
            away = tuple(at for at in range(3) if self.separate[at])
            for s in series:
                log: Any = 0.0
                for group, misfit in zip(self._groups_of(s), self._misfits_of(s), strict=True):
                    log = log + group.log_likelihood(misfit)
                for at in away:
                    log = log + self._measure(s, at)
                self.own_log[s] = log
                self.reduced[s] = special.logsumexp(log, axis=away, keepdims=True)
        self.shared_log: Any = sum(
            (self._measure(first, at) for at in range(3) if not self.separate[at]), start=np.zeros((1, 1, 1))
        )
        together = self.shared_log + sum(self.reduced.values())
        self.log_evidence = float(special.logsumexp(together))
        self.together = together

    def _groups_of(self, s: str) -> list[Noise]:
        if self.question.noise == "known":
            return [Noise("", tuple(r for r in self.question.rows if r.series == s))]
        return [g for g in self.groups if g.rows[0].series == s]

    def _misfits_of(self, s: str) -> list[Array]:
        if self.question.noise == "known":
            return self.misfits[s]
        return [m for g, m in zip(self.groups, self.misfits[s], strict=True) if g.rows[0].series == s]

    def joint_log(self, s: str) -> Array:
        """Log of the mass on the grid of one series, all others integrated out."""
        if s not in self.own_log:
            s = self.question.series[0]
        return np.asarray(self.together - self.reduced[s] + self.own_log[s] - self.log_evidence)

    def joint(self, s: str) -> Array:
        return np.exp(self.joint_log(s))

    # --- what is read off

    def quantities(self) -> dict[str, tuple[str, Any]]:
        """Label to (series, kind)."""
        q = self.question
        found: dict[str, tuple[str, Any]] = {}
        for at, name in enumerate(("e_n", q.own, "mu")):
            if name and name not in q.fix:
                for s in q.series if self.separate[at] else q.series[:1]:
                    found[f"{name}[{s}]" if self.separate[at] else name] = (s, at)
        if not ("mu" in q.fix and "e_n" in q.fix):
            many = self.separate[0] or self.separate[2]
            for s in q.series if many else q.series[:1]:
                found[f"kappa[{s}]" if many else "kappa"] = (s, "kappa")
        for group in self.groups:
            if group.name:
                found[group.name] = (group.rows[0].series, group)
        return found

    def summary(self) -> dict[str, Any]:
        """Evidence, and of every quantity the mean, sd and quantiles."""
        out: dict[str, Any] = {"log_evidence": self.log_evidence, "quantities": {}}
        for label, (s, kind) in self.quantities().items():
            mean, sd, cdf, ends = self._law(s, kind)
            quantiles = [optimize.brentq(lambda x, p=p, f=cdf: f(x) - p, *ends, xtol=1e-13) for p in LEVELS]
            out["quantities"][label] = {"mean": mean, "sd": sd, "quantiles": quantiles}
        if len(self.question.series) == 1:
            out["correlation"] = self._correlation()
        return out

    def _correlation(self) -> dict[str, float]:
        mass = self.joint(self.question.series[0])
        labels = [x for x, (_, kind) in self.quantities().items() if not isinstance(kind, Noise)]
        value = {x: self._value(*self.quantities()[x]) for x in labels}
        mean = {x: float((mass * v).sum()) for x, v in value.items()}
        centred = {x: v - mean[x] for x, v in value.items()}
        sd = {x: math.sqrt(float((mass * v**2).sum())) for x, v in centred.items()}
        return {
            f"{a} {b}": float((mass * centred[a] * centred[b]).sum()) / (sd[a] * sd[b])
            for i, a in enumerate(labels)
            for b in labels[i + 1 :]
        }

    def _value(self, s: str, kind: Any) -> Any:
        e, c, mu, _ = self.constants_at(s)
        return {0: e, 1: c, 2: mu, "kappa": mu * (1.0 + e)}[kind]

    def _law(self, s: str, kind: Any) -> tuple[float, float, Callable[[float], float], tuple[float, float]]:
        mass = self.joint(s)
        if isinstance(kind, Noise):
            return self._noise_law(s, kind, mass)
        value = self._value(s, kind)
        mean = float((mass * value).sum())
        sd = math.sqrt(float((mass * (value - mean) ** 2).sum()))
        ends = (float(np.min(value)), float(np.max(value)))
        if kind in (0, 1):
            at = kind
            marginal = mass.sum(axis=tuple(x for x in range(3) if x != at))
            axis = self.axes[s][at]
            assert axis is not None
            ends = (float(axis.edges[0]), float(axis.edges[-1]))

            below = _below(axis, marginal[None, :])
            return mean, sd, lambda x: float(below(np.array([x]))[0]), ends
        axis = self.axes[s][2]
        if axis is None:  # mu is fixed, e_n is not: kappa grows with e_n
            first = self.axes[s][0]
            assert first is not None
            marginal = mass.sum(axis=(1, 2))
            mu = self.question.fix["mu"]
            below = _below(first, marginal[None])
            return mean, sd, lambda x: float(below(np.array([x / mu - 1.0]))[0]), ends
        _, _, b0, b1 = self.question.linear()
        e, c, _ = self._values(s)
        flat = mass if b1 else mass.sum(axis=1, keepdims=True)
        scale: Any = 1.0 if self.by_mu else (b0 + b1 * c if b1 else np.full((1, 1, 1), b0))
        if kind == "kappa":
            factor = (1.0 + e) / np.ones_like(scale) if self.by_mu else scale + 0.0 * e
        else:
            factor = np.ones_like(e) * np.ones_like(scale) if self.by_mu else scale / (1.0 + e)
        factor = np.broadcast_to(factor, (*flat.shape[:2], 1))[..., 0].ravel()
        masses = flat.reshape(-1, flat.shape[2])

        below = _below(axis, masses)
        return mean, sd, lambda x: float(below(x / factor).sum()), (0.0, float(axis.edges[-1] * factor.max()))

    def _noise_law(self, s: str, group: Noise, mass: Array) -> Any:
        at = self.groups.index(group)
        coupled = not any(self.separate)
        misfit = self.totals[at] if coupled else self.misfits[s][at]
        keep = mass > 1e-22
        w, x = _binned(mass[keep], np.broadcast_to(misfit, mass.shape)[keep])
        base = group.log_moment(x, 0, group.low, group.high)
        mean, square = (
            float((w * np.exp(group.log_moment(x, p, group.low, group.high) - base)).sum()) for p in (1, 2)
        )

        def cdf(y: float) -> float:
            return float((w * np.exp(group.log_moment(x, 0, group.low, y) - base)).sum())

        return mean, math.sqrt(square - mean**2), cdf, (group.low * (1 + 1e-12), group.high)


def reference(question: Question) -> dict[str, Any]:
    """What brute force says, on a grid whose own error is 2e-5 sd or less (see test_oracles.py)."""
    return Dense(question, grid_for(question)).summary()


def grid_for(question: Question) -> tuple[int, int, int]:
    """Panels that are enough for the questions of these tests."""
    if "e_n" in question.fix:
        return 1, 20, 40
    if "mu" in question.fix or ("e_n" in question.separate and "mu" not in question.separate):
        return 30, 10, 24  # the kinks are not at panel ends
    return (8, 10, 12) if question.closure == "fr" else (12, 10, 18)


def _binned(w: Array, x: Array, bins: int = 6000) -> tuple[Array, Array]:
    """The law of x > 0 in narrow bins that keep its mean: what is smooth in log x keeps eight digits."""
    log = np.log(x)
    low, high = float(log.min()), float(log.max())
    at = np.minimum(((log - low) / max(high - low, 1e-300) * bins).astype(int), bins - 1)
    mass, moment = (np.bincount(at, y, bins) for y in (w, w * x))
    held = mass > 0.0
    return mass[held] / mass.sum(), moment[held] / mass[held]


def _below(axis: Axis, masses: Array) -> Callable[[Array], Array]:
    """Mass below x along the last direction; one x a row of masses (which include the weights)."""
    full = np.concatenate([np.zeros((len(masses), 1)), np.cumsum(masses, axis=1)], axis=1)
    rows = np.arange(len(masses))

    def below(x: Array) -> Array:
        _, inside, first = axis.until(np.clip(x, axis.edges[0], axis.edges[-1]))
        columns = first[:, None] + np.arange(axis.order)
        density = masses[rows[:, None], columns] / axis.weights[columns]
        return np.asarray(full[rows, first] + (density * inside).sum(axis=1))

    return below
