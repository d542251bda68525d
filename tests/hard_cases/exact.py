"""The least-squares optimum of beta by brute force in 80-digit arithmetic.

Nothing is shared with the package: every partition of the rows into sticking and sliding is a quadratic in
(c, kappa); its minimum over the polygon between two neighbouring transitions and the bounds lies at the free
minimum, on one of the lines, or where two of them meet. All of these are tried in all N + 1 partitions, and
each is judged by the sum of squares of the law itself, so that no candidate can claim too little.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from mpmath import mp, mpf, radians, tan

DIGITS = 80
Line = tuple[Any, Any, Any]  # (p, q, r): p c + q kappa = r


@dataclass(frozen=True)
class Law:
    """beta(tau) = min(stick, slide), both linear in c, with c and kappa inside their bounds.

    stick = c + stick0; slide = slide1 c + slide0 + 7/2 kappa/tau; bounds of c; kappa >= 0.
    """

    stick0: str
    slide1: str
    slide0: str
    lower: str
    upper: str


IFR = Law("1.4", "1", "0", "-1", "-0.4")
FR = Law("0", "0", "-1", "-1", "1")


def best_chi2(
    gamma: Sequence[float], beta: Sequence[float], sigma: Sequence[float], law: Law = IFR
) -> tuple[Any, Any, Any]:
    """Lowest sum of squares over everything, and where: (chi2, c, kappa), for impacts without spin."""
    with mp.workdps(DIGITS):
        points = sorted(
            (tan(radians(mpf(g))), mpf(b), 1 / mpf(s)) for g, b, s in zip(gamma, beta, sigma, strict=True)
        )
        stick0, slide1, slide0, lower, upper = (mpf(x) for x in vars(law).values())

        def chi2(c: Any, kappa: Any) -> Any:
            total = mpf(0)
            for tau, b, w in points:
                fitted = min(c + stick0, slide1 * c + slide0 + mpf("3.5") * kappa / tau)
                total += ((b - fitted) * w) ** 2
            return total

        def allowed(c: Any, kappa: Any) -> bool:
            hair = mpf(10) ** -60
            return lower - hair <= c <= upper + hair and kappa >= -hair

        box: list[Line] = [(mpf(1), mpf(0), lower), (mpf(1), mpf(0), upper), (mpf(0), mpf(1), mpf(0))]
        best = None
        for m in range(len(points) + 1):
            # the transition: 7/2 kappa = tau (stick - slide without kappa)
            kinks = [
                (-tau * (1 - slide1), mpf("3.5"), tau * (stick0 - slide0))
                for tau, _, _ in points[max(m - 1, 0) : m + 1]
            ]
            design = [(w, mpf(0), w * (b - stick0)) for _, b, w in points[:m]]
            design += [(w * slide1, w * mpf("3.5") / tau, w * (b - slide0)) for tau, b, w in points[m:]]
            for candidate in _candidates(design, [*box, *kinks]):
                if allowed(*candidate):
                    found = (chi2(*candidate), *candidate)
                    best = found if best is None or found[0] < best[0] else best
        assert best is not None
        return best


def _candidates(design: list[Line], lines: list[Line]) -> list[tuple[Any, Any]]:
    """Free minimum, minimum on each line, and every corner."""
    found = [_solve(*_normal(design))]
    found += [_on_line(design, line) for line in lines]
    found += [_solve(a, b) for a, b in itertools.combinations(lines, 2)]
    return [x for x in found if x is not None]


def _normal(design: list[Line]) -> tuple[Line, Line]:
    pp = sum((p * p for p, _, _ in design), mpf(0))
    pq = sum((p * q for p, q, _ in design), mpf(0))
    qq = sum((q * q for _, q, _ in design), mpf(0))
    pr = sum((p * r for p, _, r in design), mpf(0))
    qr = sum((q * r for _, q, r in design), mpf(0))
    return (pp, pq, pr), (pq, qq, qr)


def _solve(first: Line, second: Line) -> tuple[Any, Any] | None:
    """Cramer's rule; None if the two say the same."""
    det = first[0] * second[1] - first[1] * second[0]
    size = abs(first[0] * second[1]) + abs(first[1] * second[0])
    if size == 0 or abs(det) <= size * mpf(10) ** -60:
        return None
    c = (first[2] * second[1] - first[1] * second[2]) / det
    return c, (first[0] * second[2] - first[2] * second[0]) / det


def _on_line(design: list[Line], line: Line) -> tuple[Any, Any] | None:
    """Minimum along p c + q kappa = r, by its own parameter."""
    p, q, r = line
    size = p * p + q * q
    start, way = (p * r / size, q * r / size), (-q, p)
    slopes = [dp * way[0] + dq * way[1] for dp, dq, _ in design]
    rest = [dr - dp * start[0] - dq * start[1] for dp, dq, dr in design]
    square = sum((s * s for s in slopes), mpf(0))
    if square == 0:
        return None
    step = sum((s * x for s, x in zip(slopes, rest, strict=True)), mpf(0)) / square
    return start[0] + step * way[0], start[1] + step * way[1]
