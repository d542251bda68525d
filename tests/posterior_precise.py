"""The same posteriors in 30-digit arithmetic, for known noise and observables linear in the impulse.

Given t = kappa/b(c), the slip ratio at which sticking ends, every row is linear in c whatever the closure, so
c integrates in closed form between its bounds; t and e_n are integrated by Gauss-Legendre rules on short
panels that break at the kinks. The dense oracle only says where the panels should lie.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from mpmath import mp, mpf
from posterior_dense import Dense
from posterior_questions import Question, Row

DIGITS = 30
_REACH = 9  # sd of e_n either side: the tails beyond hold 1e-19


@cache
def rule(order: int) -> tuple[tuple[Any, Any], ...]:
    """Gauss-Legendre nodes and weights to all digits: numpy's, polished by Newton's method."""
    with mp.workdps(DIGITS + 5):
        found = []
        for start in np.polynomial.legendre.leggauss(order)[0]:
            x = mpf(float(start))
            for _ in range(3):
                before, here = mpf(1), x
                for n in range(2, order + 1):
                    before, here = here, ((2 * n - 1) * x * here - (n - 1) * before) / n
                slope = order * (x * here - before) / (x * x - 1)
                x -= here / slope
            found.append((x, 2 / ((1 - x * x) * slope * slope)))
        return tuple(found)


def nodes(breaks: Sequence[Any], widest: Any, order: int) -> list[tuple[Any, Any]]:
    """Nodes and weights on panels no wider than `widest` that break where told."""
    found = []
    for low, high in itertools.pairwise(breaks):
        pieces = max(1, math.ceil((high - low) / widest))
        half = (high - low) / (2 * pieces)
        for i in range(pieces):
            middle = low + half * (2 * i + 1)
            found += [(middle + half * x, half * w) for x, w in rule(order)]
    return found


class Precise:
    """Evidence and moments of (e_n, c, kappa, mu), and the law of c and kappa, to many digits."""

    def __init__(self, question: Question, order: int = 20) -> None:
        self.question, self.order = question, order
        self.prior_mass: dict[str, Any] = {}
        self.rough = Dense(question, pieces=(8, 8, 12), order=6)
        if "mu" not in question.fix and "e_n" not in question.fix and not question.prior.get("mu"):
            _, _, cdf, _ = self.rough._law(question.series[0], 2)
            if 1.0 - cdf(0.9 * question.domain("mu")[1]) > 1e-12:
                raise ValueError("the bound of mu ties kappa to e_n here: nothing separates")
        with mp.workdps(DIGITS):
            self._set_up()
            self.z, self.sums = self._integral()

    def _set_up(self) -> None:
        q = self.question
        j = mpf(str(q.inertia_factor))
        share = j / (1 + j)
        self.a0, self.a1, self.b0, self.b1 = {
            "ifr": (share, share, j, 0),
            "ifr-contact": (share, share, share, 0),
            "fr": (0, 0, share, share),
            "f": (0, 0, share, 0),
        }[q.closure]
        self.j, self.share = j, share
        self.tangential = [r for r in q.rows if r.observable not in ("e_n", "mu", "v_n")]
        self.normal = [r for r in q.rows if r.observable in ("e_n", "v_n")]
        self.friction = [r for r in q.rows if r.observable == "mu"]
        self.lines = [self._line(r) for r in self.tangential]
        self.e_nodes = self._e_nodes()
        self.coupled = bool(self.friction) or "mu" in q.prior
        if self.coupled and self.b1 and len(self.e_nodes) > 1:
            raise ValueError("mu, c and e_n are coupled here: no closed form")

    def _line(self, row: Row) -> tuple[Any, Any, Any, Any, Any]:
        """(tau, offset, slope, value, weight) of value = offset + slope k."""
        angle = mp.radians(mpf(row.gamma))
        sine, cosine = mp.sin(angle), mp.cos(angle)
        s_x, s_y = mpf(row.spin_x), mpf(row.spin_y)
        u_x, u_y = sine + s_y, s_x
        offset, slope = {
            "beta": lambda: (mpf(-1), 1 / self.share),
            "beta_cm": lambda: (mpf(-1), u_x / sine),
            "tan_psi_after": lambda: (u_x / cosine, -u_x / cosine / self.share),
            "spin_y_after": lambda: (s_y, -u_x / self.j),
            "spin_x_after": lambda: (s_x, -u_y / self.j),
            "v_x": lambda: (sine, -u_x),
            "v_y": lambda: (mpf(0), -u_y),
        }[row.observable]()
        return mp.hypot(u_x, u_y) / cosine, offset, slope, mpf(row.value), 1 / mpf(row.sigma)

    def _box(self, name: str) -> tuple[Any, Any, Any]:
        """Ends of the range that matters, and the sd."""
        q = self.question
        mean, sd, _, _ = self.rough._law(*self.rough.quantities()[name])
        low, high = (mpf(x) for x in ((0, mp.inf) if name == "kappa" else q.domain(name)))
        return max(low, mpf(mean) - _REACH * mpf(sd)), min(high, mpf(mean) + _REACH * mpf(sd)), mpf(sd)

    def _density(self, name: str, x: Any) -> Any:
        """Normalised prior of one constant inside its domain."""
        q = self.question
        low, high = (mpf(v) for v in q.domain(name))
        if name in q.prior:
            mean, sd = (mpf(v) for v in q.prior[name])
            if name not in self.prior_mass:
                self.prior_mass[name] = mp.ncdf((high - mean) / sd) - mp.ncdf((low - mean) / sd)
            return mp.npdf(x, mean, sd) / self.prior_mass[name]
        return 1 / (high - low)

    def _e_nodes(self) -> list[tuple[Any, Any]]:
        """(e_n, weight with prior and likelihood)."""
        q = self.question

        def likelihood(e: Any) -> Any:
            out = mpf(1)
            for row in self.normal:
                cosine = 1 if row.observable == "e_n" else mp.cos(mp.radians(mpf(row.gamma)))
                out *= mp.npdf(mpf(row.value), e * cosine, mpf(row.sigma))
            return out

        if "e_n" in q.fix:
            e = mpf(q.fix["e_n"])
            return [(e, likelihood(e))]
        low, high, sd = self._box("e_n")
        found = nodes([low, high], 3 * sd, self.order)
        return [(e, w * likelihood(e) * self._density("e_n", e)) for e, w in found]

    def _c_moments(self, t: Any, low: Any, high: Any, e: Any) -> list[Any]:
        """Integrals of likelihood x prior x b(c) x c^m over c from low to high, m = 0, 1, 2."""
        q = self.question
        aa = ab = bb = mpf(0)  # sum of ((r - s c) w)^2 = bb - 2 ab c + aa c^2
        norm = mpf(1)
        rows = []
        for tau, offset, slope, value, w in self.lines:
            ratio = min(mpf(1), t / tau)
            rows.append(
                (slope * (self.a1 + self.b1 * ratio), value - offset - slope * (self.a0 + self.b0 * ratio), w)
            )
        if self.coupled and self.b1:
            reach = t / (1 + e)
            known = [(mpf(r.value), mpf(r.sigma)) for r in self.friction]
            if "mu" in q.prior:
                known.append((mpf(q.prior["mu"][0]), mpf(q.prior["mu"][1])))
                norm *= self._density("mu", known[-1][0]) / mp.npdf(0, 0, known[-1][1])
            rows += [(reach * self.b1, v - reach * self.b0, 1 / s) for v, s in known]
        for s, r, w in rows:
            aa, ab, bb = aa + (s * w) ** 2, ab + s * r * w * w, bb + (r * w) ** 2
            norm *= w / mp.sqrt(2 * mp.pi)
        if not q.own or q.own in q.fix:
            c = mpf(q.fix[q.own]) if q.own else mpf(0)
            z = norm * mp.exp(-(bb - 2 * ab * c + aa * c * c) / 2) * (self.b0 + self.b1 * c)
            return [z, z * c, z * c * c]
        if q.own in q.prior:
            mean, sd = (mpf(v) for v in q.prior[q.own])
            aa, ab, bb = aa + 1 / sd**2, ab + mean / sd**2, bb + (mean / sd) ** 2
            norm *= self._density(q.own, mean)
        else:
            norm *= self._density(q.own, low)
        if aa == 0:
            raw = [norm * mp.exp(-bb / 2) * (high ** (m + 1) - low ** (m + 1)) / (m + 1) for m in range(4)]
        else:
            centre, sd = ab / aa, 1 / mp.sqrt(aa)
            top = norm * mp.exp(-(bb - ab * ab / aa) / 2)
            x, y = (low - centre) / sd, (high - centre) / sd
            # moments of the standard normal law between x and y, the mass from the side that does not cancel
            mass = mp.ncdf(-x) - mp.ncdf(-y) if x > 0 else mp.ncdf(y) - mp.ncdf(x)
            px, py = mp.npdf(x), mp.npdf(y)
            n = [mass, px - py, mass + x * px - y * py, x * x * px - y * y * py + 2 * (px - py)]
            root = top * sd * mp.sqrt(2 * mp.pi)
            raw = [
                root * sum(mp.binomial(m, i) * centre ** (m - i) * sd**i * n[i] for i in range(m + 1))
                for m in range(4)
            ]
        return [self.b0 * raw[m] + self.b1 * raw[m + 1] for m in range(3)]

    def _integral(self, c_to: Any = None, t_to: Any = None) -> tuple[Any, dict[str, Any]]:
        q = self.question
        c_low, c_high = (mpf(v) for v in (q.domain(q.own) if q.own else (0, 0)))
        c_high = c_high if c_to is None else min(c_high, mpf(c_to))
        edges = [mpf(float(x)) for x in self.rough.axes[q.series[0]][2].edges]
        low, high = edges[0], edges[-1] if t_to is None else min(edges[-1], t_to)
        breaks = sorted(
            {low, high, *(x for x in [*edges, *(line[0] for line in self.lines)] if low < x < high)}
        )
        sums: dict[str, Any] = dict.fromkeys(("1", "e", "ee", "c", "cc", "k", "kk", "m", "mm"), mpf(0))
        fixed_density = None if self.coupled else self._density("mu", mpf(q.domain("mu")[0]))
        once = self._e_sums(None, fixed_density) if not self.coupled else None
        for t, w in nodes(breaks, (high - low) / 8, self.order):
            z = [x * w for x in self._c_moments(t, c_low, c_high, self.e_nodes[0][0])]
            e_sums = once
            if e_sums is None:
                e_sums = self._e_sums(None if self.b1 else t * self.b0, None)
            one, e, ee, inverse, inverse2 = e_sums
            sums["1"] += z[0] * one
            sums["e"], sums["ee"] = sums["e"] + z[0] * e, sums["ee"] + z[0] * ee
            sums["c"], sums["cc"] = sums["c"] + z[1] * one, sums["cc"] + z[2] * one
            if self.b1:
                # kappa = t (b0 + b1 c)
                b = t * (self.b0 * z[0] + self.b1 * z[1])
                bb = t * t * (self.b0**2 * z[0] + 2 * self.b0 * self.b1 * z[1] + self.b1**2 * z[2])
            else:
                b, bb = t * self.b0 * z[0], (t * self.b0) ** 2 * z[0]
            sums["k"], sums["kk"] = sums["k"] + b * one, sums["kk"] + bb * one
            sums["m"], sums["mm"] = sums["m"] + b * inverse, sums["mm"] + bb * inverse2
        return sums["1"], sums

    def _e_sums(self, kappa: Any, density: Any) -> list[Any]:
        """Integrals over e_n of 1, e, e^2, 1/(1 + e) and its square, with the Jacobian 1/(1 + e)."""
        total = [mpf(0)] * 5
        for e, w in self.e_nodes:
            f = w / (1 + e)
            if density is not None:
                f *= density
            elif kappa is not None:
                mu = kappa / (1 + e)
                f *= self._density("mu", mu)
                for row in self.friction:
                    f *= mp.npdf(mpf(row.value), mu, mpf(row.sigma))
            i = 1 / (1 + e)
            total = [x + f * y for x, y in zip(total, (1, e, e * e, i, i * i), strict=True)]
        return total

    def log_evidence(self) -> float:
        with mp.workdps(DIGITS):
            return float(mp.log(self.z))

    def moments(self) -> dict[str, tuple[float, float]]:
        """Mean and sd of every free constant and kappa."""
        q = self.question
        letter = {"e_n": "e", q.own: "c", "kappa": "k", "mu": "m"}
        with mp.workdps(DIGITS):
            found = {}
            for name in self.rough.quantities():
                x = letter[name]
                mean = self.sums[x] / self.z
                found[name] = (float(mean), float(mp.sqrt(self.sums[x * 2] / self.z - mean**2)))
            return found

    def cdf_c(self, x: float) -> float:
        """Probability that the closure's constant lies below x."""
        with mp.workdps(DIGITS):
            return float(self._integral(c_to=x)[0] / self.z)

    def cdf_kappa(self, x: float) -> float:
        """Probability that kappa lies below x, where b does not depend on c."""
        with mp.workdps(DIGITS):
            return float(self._integral(t_to=mpf(x) / self.b0)[0] / self.z)
