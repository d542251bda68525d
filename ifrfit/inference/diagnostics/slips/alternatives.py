"""Slips without a size: the table as it should have been, where a sign, an angle or a name is another one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ifrfit.inference.model.problem import Problem
from ifrfit.inference.model.rows import Array, Bool, Index
from ifrfit.physics.angles import Incidence
from ifrfit.physics.observables import OBSERVABLES

_FEWEST_RANKED = 8  # values that ascend with the angle by no chance
_OF_GON = 0.9  # degrees
_TALL = 1.5  # median size of a fraction from which it may be in percent
_NEAREST = 1e-3  # share of the angles' range by which a number may lie beyond its end
_EXCHANGED = (
    ("beta", "beta_cm"),
    ("tan_psi_after", "tan_psi_out"),
    ("psi_after_deg", "psi_out_deg"),
    ("delta_deg", "psi_out_deg"),
    ("e_n", "beta_tot"),
)
SPEEDS = ("e_n", "beta_tot", "v_n")  # ratios of speeds, which energies or heights are the squares of
_FRACTIONS = ("v_x", "v_y", "v_n", "beta_cm", "e_n", "beta", "mu_app", "beta_tot", "mu")
# what given spins are, over the true ones
SPIN_UNITS = {
    "spins-doubled": 2.0,
    "spins-halved": 0.5,
    "spins-in-hertz": 0.5 / math.pi,
    "spins-in-rpm": 30.0 / math.pi,
    "spins-read-as-hertz": 2.0 * math.pi,
    "spins-read-as-rpm": math.pi / 30.0,
}


@dataclass(frozen=True)
class Alternative:
    """What the closure would give for the table as it stands, if it were meant in another way.

    Attributes
    ----------
    name : str
    observable : str
        Whose values are meant in another way; empty where angles or spins before impact are.
    series : str
        The one series it is in; empty where it is in all.
    meant : Problem
        With the observables, angles and spins that are meant.
    shift, factor : ndarray, (n,)
        A given value is shift + factor times the one that is meant.
    folded : ndarray of bool, (n,)
        Whether it is the size of that.
    squared : ndarray of bool, (n,)
        Whether it is the square of that.
    ranked : ndarray of int
        Rows among which the values stand in ascending order, whichever impact they are of.
    """

    name: str
    observable: str
    series: str
    meant: Problem
    shift: Array
    factor: Array
    folded: Bool
    squared: Bool
    ranked: Index

    def values(self, theta: Array) -> Array:
        """Values as they would be given, (m, n), from theta, (m, p)."""
        found = self.shift + self.factor * self.meant.predict(theta)
        found = np.where(self.folded, np.abs(found), found) if self.folded.any() else found
        if self.ranked.size:
            found = found.copy()
            found[..., self.ranked] = np.sort(found[..., self.ranked], axis=-1)
        with np.errstate(over="ignore"):  # a step that leads so far is not taken
            return np.where(self.squared, found**2, found) if self.squared.any() else found

    def values_of_rows(self, theta: Array, rows: Index) -> Array:
        """The same for some of the rows, (m, rows)."""
        if self.ranked.size:  # a rank is one among all
            return self.values(theta)[..., rows]
        return self.of_rows(rows).values(theta)

    def of_rows(self, rows: Index) -> Alternative:
        """Some of the rows of a table that is not `ranked`."""
        return replace(
            self,
            meant=replace(self.meant, rows=self.meant.rows.take(rows)),
            shift=self.shift[rows],
            factor=self.factor[rows],
            folded=self.folded[rows],
            squared=self.squared[rows],
        )


def alternatives(
    problem: Problem, series: int | None = None, *, other_units: bool = True, shifted: bool = True
) -> Iterator[Alternative]:
    """Every table that these rows, or those of one series, could have been meant as.

    `other_units` asks for those of spins, too, which the scale of spins shows first; `shifted` for columns
    that are shifted by a line, which leave the law little to explain.
    """
    n = len(problem.rows)
    of = np.ones(n, dtype=bool) if series is None else problem.rows.series == series
    table = _Table(problem, of, "" if series is None else problem.series[series])
    yield from _of_signs(table)
    if other_units:
        yield from _of_spin_units(table)
    yield from _of_angles(table)
    yield from _of_values(table)
    yield from _of_names(table)
    if shifted:
        yield from _of_shifts(table)


def in_any_order(problem: Problem, observable: str) -> Alternative:
    """Values of an observable beside angles that are not theirs: those of the law, by rank."""
    rows = problem.rows.rows_of(observable)
    table = _Table(problem, np.ones(len(problem.rows), dtype=bool), "")
    return table.meant("sorted", observable, ranked=rows[np.argsort(problem.rows.value[rows], kind="stable")])


@dataclass(frozen=True)
class _Table:
    """A table, some rows of which may be meant in another way."""

    problem: Problem
    of: Bool
    series: str

    def rows_of(self, observable: str) -> Index:
        """Those of an observable that may be."""
        if observable not in self.problem.rows.names:
            return np.array([], dtype=np.intp)
        at = self.problem.rows.rows_of(observable)
        return at[self.of[at]]

    @property
    def names(self) -> tuple[str, ...]:
        """Observables of these rows."""
        return tuple(name for name in self.problem.rows.names if self.rows_of(name).size)

    def meant(
        self,
        name: str,
        observable: str = "",
        *,
        incidence: Incidence | None = None,
        values: dict[str, tuple[float, float]] | None = None,
        exchanged: dict[str, str] | None = None,
        folded: str = "",
        squared: str = "",
        ranked: Index | None = None,
    ) -> Alternative:
        """The table with other numbers, or with other names, in these rows."""
        rows = self.problem.rows
        shift, factor = np.zeros(len(rows)), np.ones(len(rows))
        size, square = np.zeros((2, len(rows)), dtype=bool)
        for one, (offset, slope) in (values or {}).items():
            at = self.rows_of(one)
            shift[at], factor[at] = offset, slope
        if folded:
            size[self.rows_of(folded)] = True
        if squared:
            square[self.rows_of(squared)] = True
        names, which = rows.names, rows.which
        for here, there in (exchanged or {}).items():
            names = names if there in names else (*names, there)
            which = which if which is not rows.which else which.copy()
            which[self.rows_of(here)] = names.index(there)
        own = rows.incidence if incidence is None else incidence
        rows = replace(rows, names=names, which=which, incidence=own, tau=own.tau)
        problem = replace(self.problem, rows=rows)
        by_rank = np.empty(0, dtype=np.intp) if ranked is None else ranked
        return Alternative(name, observable, self.series, problem, shift, factor, size, square, by_rank)

    def incidence(self, spin_x: float = 1.0, spin_y: float = 1.0, gamma: Array | None = None) -> Incidence:
        """With spins of these rows times a factor, or other angles."""
        rows = self.problem.rows
        i = rows.incidence
        turned = rows.gamma_deg if gamma is None else np.where(self.of, gamma, rows.gamma_deg)
        spins = (np.where(self.of, by * spin, spin) for by, spin in ((spin_x, i.spin_x), (spin_y, i.spin_y)))
        return Incidence.of(turned, *spins, degrees=True)


def _of_signs(table: _Table) -> Iterator[Alternative]:
    i = table.problem.rows.incidence
    for axis, before in (("y", i.spin_y), ("x", i.spin_x)):
        sign = {"y": (1.0, -1.0), "x": (-1.0, 1.0)}[axis]
        after = f"spin_{axis}_after"
        has_before, has_after = bool(before[table.of].any()), table.rows_of(after).size > 0
        opposite = {after: (0.0, -1.0)}
        if has_before:
            yield table.meant(f"sign-of-spin-{axis}-before", incidence=table.incidence(*sign))
        if has_after:
            yield table.meant(f"sign-of-spin-{axis}-after", after, values=opposite)
        if has_before and has_after:
            both = table.incidence(*sign)
            yield table.meant(f"sign-of-spins-{axis}", after, incidence=both, values=opposite)


def _of_spin_units(table: _Table) -> Iterator[Alternative]:
    i = table.problem.rows.incidence
    before = bool(i.spin_x[table.of].any() or i.spin_y[table.of].any())
    after = [name for name in ("spin_y_after", "spin_x_after") if table.rows_of(name).size]
    for name, factor in SPIN_UNITS.items():
        values, of = dict.fromkeys(after, (0.0, factor)), " and ".join(after)
        if before or after:
            given = table.incidence(1.0 / factor, 1.0 / factor)
            yield table.meant(name, of, incidence=given, values=values)
        if before and after:
            yield table.meant(f"{name}-after", of, values=values)


def _of_angles(table: _Table) -> Iterator[Alternative]:
    rows = table.problem.rows
    gamma, angled = rows.gamma_deg, rows.has_angle & table.of
    if not angled.any() or not np.ptp(gamma[angled]) > 0.0:
        return
    after = {name: (90.0, -1.0) for name in table.names if _from_wall(table, name)}
    read = {name: (0.0, 1.0 / _OF_GON) for name in table.names if OBSERVABLES[name].unit == "deg"}
    for name, other in (
        ("angle-from-wall", 90.0 - gamma),
        ("angle-in-radians", np.degrees(gamma)),
        ("angle-in-gon", _OF_GON * gamma),
    ):
        if float(other[table.of].max()) <= 90.0 * (1.0 + _NEAREST):
            incidence = table.incidence(gamma=np.minimum(other, 90.0))
            yield table.meant(name, incidence=incidence)
            if after and name == "angle-from-wall":
                yield table.meant("angles-from-wall", " and ".join(after), incidence=incidence, values=after)
            if read and name == "angle-in-gon":
                yield table.meant("angles-in-gon", " and ".join(read), incidence=incidence, values=read)


def _from_wall(table: _Table, name: str) -> bool:
    """Whether these may be angles after impact that were measured from the wall."""
    own = table.problem.rows.value[table.rows_of(name)]
    return OBSERVABLES[name].unit == "deg" and -_NEAREST * 90.0 <= float(np.median(own)) <= 90.0


def _of_values(table: _Table) -> Iterator[Alternative]:
    """Signs, sizes, squares, order, percent, and of angles after impact radians and those from the wall."""
    for name in table.names:
        observable, own = OBSERVABLES[name], table.problem.rows.value[table.rows_of(name)]
        made = {}
        if observable.low < 0.0:
            if not name.startswith("spin_"):
                made["sign"] = (0.0, -1.0)
            if bool((own >= 0.0).all()):
                yield table.meant("size", name, folded=name)
        by_angle = own[np.argsort(table.problem.rows.gamma_deg[table.rows_of(name)], kind="stable")]
        if own.size >= _FEWEST_RANKED and (_is_monotone(own) or _is_monotone(by_angle)):
            yield table.meant("sorted", name, ranked=table.rows_of(name)[np.argsort(own, kind="stable")])
        if name in SPEEDS:
            yield table.meant("squared", name, squared=name)
        if name in _FRACTIONS and float(np.median(np.abs(own))) > _TALL:
            made["percent"] = (0.0, 100.0)
        if observable.unit == "deg" and float(np.abs(own).max()) <= math.pi:
            made["radians"] = (0.0, math.pi / 180.0)
        if _from_wall(table, name):
            made["from-wall"] = (90.0, -1.0)
        for kind, numbers in made.items():
            yield table.meant(kind, name, values={name: numbers})


def _is_monotone(value: Array) -> bool:
    """Whether values never fall, or never rise."""
    step = np.diff(value)
    return bool((step >= 0.0).all() or (step <= 0.0).all())


def _of_shifts(table: _Table) -> Iterator[Alternative]:
    """Values, of all observables or of one, that stand a line below or above their angle and spin."""
    rows, angled = table.problem.rows, [n for n in table.names if OBSERVABLES[n].has_angle]
    for name in ("", *(angled if len(angled) > 1 else ())):
        for word, by in (("down", 1), ("up", -1)):
            at = np.arange(len(rows))
            for one in (name,) if name else angled:
                own = table.rows_of(one)
                for series in np.unique(rows.series[own]):
                    here = own[rows.series[own] == series]
                    at[here] = np.roll(here, by)
            of = name or (angled[0] if len(angled) == 1 else "")
            yield table.meant(f"shifted-{word}", of, incidence=rows.incidence.take(at))


def _of_names(table: _Table) -> Iterator[Alternative]:
    """Values that are of another observable of the same kind of number."""
    for pair in _EXCHANGED:
        for here, there in (pair, pair[::-1]):
            if here in table.names and there not in table.names:
                yield table.meant(f"meant-{there}", here, exchanged={here: there})
    if {"v_x", "v_n"} <= set(table.names):
        yield table.meant("exchanged", "v_x and v_n", exchanged={"v_x": "v_n", "v_n": "v_x"})
