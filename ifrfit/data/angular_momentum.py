"""Angular momentum about the contact point: a check of measured velocities that no closure enters."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ifrfit.data.cell_table import Cells
from ifrfit.physics.angles import Array
from ifrfit.physics.inertia import BODIES, is_plausible

LIMIT = 0.05
# A suggested inertia factor that closes no better than this share of the miss explains nothing.
_EXPLAINS = 0.5
# What is measured is rarely sharper: within this share of a known body, that body is meant.
_SAME_BODY = 0.025
# Share of the impacts, and their least number, that must close for those that miss to be the fault;
# and how far these miss, over the limit.
_SOME, _FEWEST, _FAR = 0.25, 3, 10.0
# what is systematic in the miss: its share of the limit that counts, the p value from which it is looked at,
# and the rms beyond which, or the number of impacts below which, errors are no excuse
_PART, _LOOKED_AT, _NOISY, _MANY = 0.5, 1e-3, 0.3, 8
# factors between a radius and a diameter, radians, revolutions per second and per minute
_SPIN_UNITS = (2.0, 0.5, 2.0 * np.pi, 0.5 / np.pi, 30.0 / np.pi, np.pi / 30.0)


@dataclass(frozen=True)
class MomentumCheck:
    """How well v_t - J R Omega is conserved over the impacts of one source.

    The impulse acts at the contact point, so it changes v_t by p and R Omega by p/J: the difference stays,
    whatever the closure. A wrong inertia factor, size, sign or time of reading shows here.

    Attributes
    ----------
    n : int
        Impacts with velocity and spin after.
    rms : float
        Root mean square of the miss over that of the incoming contact speed.
    n_violating : int
        Impacts that miss by more than `limit` of their own contact speed.
    limit : float
        Largest `rms` that is taken as closing.
    inertia_factor : float
        J = I/(m R^2) that the check assumed.
    suggested : float or None
        The inertia factor that the velocities themselves ask for (least squares of the changes), where it is
        possible and would explain the miss; None otherwise.
    source : str
        Name of the source.
    systematic : float
        Root mean square of the part of the miss that goes with the change of spin or is the same in all
        impacts, over that of the incoming contact speed; 0 where it is no more than errors make.
    where : str
        The first of the violating lines, in words.
    of_pair : bool
        Whether the impacts are collisions of two equal spheres, whose spins count as their sum.
    """

    n: int
    rms: float
    n_violating: int
    limit: float
    inertia_factor: float
    suggested: float | None
    source: str
    systematic: float = 0.0
    where: str = ""
    of_pair: bool = False

    @property
    def ok(self) -> bool:
        """Whether angular momentum closes over all impacts: within the limit, or but for errors of each."""
        return self.rms <= self.limit or (self._is_scatter and not self._some_close)

    @property
    def _is_scatter(self) -> bool:
        """Whether the miss is one of errors: nothing of it goes with the change of spin, or is in all."""
        return self.rms <= _NOISY and self.systematic <= _PART * self.limit

    @property
    def says(self) -> str:
        """The check in a sentence or two, with the remedy where it fails."""
        if self.ok:
            over = f"rms over {self.n} impact{'s' if self.n > 1 else ''}"
            text = (
                f"{self.source}: angular momentum about the contact {self._closes} "
                f"({over}, inertia factor {self.inertia_factor:.4g})"
            )
            if self.rms > self.limit:
                return f"{text}, as far as errors of that size tell."
            return text + (f"; {self._beyond}." if self.n_violating else ".")
        if self._some_close:
            return (
                f"{self.source}: {self.miss}. The other {self.n - self.n_violating} close, so that no "
                "inertia factor is the reason: look at the unit and the sign of the spins in these lines."
            )
        if self.suggested is None or not is_plausible(self.suggested):
            return (
                f"{self.source}: {self.miss}. Check the signs of the spins, the size, and the inertia factor "
                f"{self.inertia_factor:.4g} (--inertia-factor){self._sum_of_spins}{self.unit_of_spins}."
            )
        factor, body = _body(self.suggested)
        return (
            f"{self.source}: the velocities contradict the inertia factor {self.inertia_factor:.4g}; try "
            f"--inertia-factor {factor:.3g}{body}, or check size and signs{self._sum_of_spins}"
            f"{self.unit_of_spins}. With "
            f"{self.inertia_factor:.4g}, {self.miss}."
        )

    @property
    def miss(self) -> str:
        """By how much angular momentum does not close, without a remedy."""
        # scatter of the contact speeds: the rms may be beyond the limit where no single impact is
        beyond = f"; {self._beyond}" if self.n_violating else ""
        over = f"rms over {self.n} impact{'s' if self.n > 1 else ''}"
        return f"angular momentum about the contact only {self._closes} ({over}){beyond}"

    @property
    def _closes(self) -> str:
        return f"closes to {100 * self.rms:.2g} % of the contact speed"

    @property
    def _beyond(self) -> str:
        return f"{self.n_violating} of {self.n} miss by more than {100 * self.limit:g} % ({self.where})"

    @property
    def _some_close(self) -> bool:
        """Whether some impacts close while others miss by far: no number for all of them does that."""
        far = self.rms**2 * self.n > (_FAR * self.limit) ** 2 * self.n_violating
        return far and self.n - self.n_violating >= max(_FEWEST, _SOME * self.n)

    @property
    def unit_of_spins(self) -> str:
        """Spins in another unit ask for an inertia factor that is as many times as large."""
        factor = (self.suggested or 0.0) / self.inertia_factor
        if not any(abs(factor / unit - 1.0) <= _SAME_BODY for unit in _SPIN_UNITS):
            return ""
        return (
            f": spins {factor:.3g} times as large close as well (radius for diameter, revolutions for "
            "radians, minutes for seconds?)"
        )

    @property
    def _sum_of_spins(self) -> str:
        return (
            ", and that spins are the sum of both spheres' (one of them asks for 2 J)" if self.of_pair else ""
        )


def _body(suggested: float) -> tuple[float, str]:
    """Return the factor to try and what it stands for: that of a known body where one is near."""
    for factor, body in BODIES.items():
        if abs(suggested / factor - 1.0) <= _SAME_BODY:
            return factor, f" ({body}; the velocities ask for {suggested:.3f})"
    return suggested, ""


def check_momentum(
    cells: Cells,
    before: Mapping[str, Any],
    after: Mapping[str, Array],
    tangential: Array,
    inertia_factor: float,
    *,
    of_pair: bool = False,
) -> MomentumCheck | None:
    """Check that v_t - J R Omega is conserved, in the paper's signs.

    Parameters
    ----------
    cells : Cells
        For the names of file and lines.
    before : mapping
        ``spin_x``, ``spin_y``: R omega/u.
    after : mapping
        ``v_x``, ``spin_y_after`` and, where measured, ``v_y`` and ``spin_x_after``, per incoming speed.
    tangential : (n,) array
        Tangential speed before, over u.
    inertia_factor : float
        J = I/(m R^2).
    of_pair : bool
        As `MomentumCheck` has it.

    Returns
    -------
    MomentumCheck or None
        None if no impact has both velocity and spin after.
    """
    if "v_x" not in after or "spin_y_after" not in after:
        return None
    dv, ds = _changes(before, after, tangential)
    miss = np.sqrt(np.sum((dv - inertia_factor * ds) ** 2, axis=0))
    contact = np.hypot(tangential + before["spin_y"], before["spin_x"])
    known = ~np.isnan(miss) & ~np.isnan(contact)
    if not np.any(contact[known] > 0):
        return None
    scale = float(np.mean(contact[known] ** 2))
    rms = float(np.sqrt(np.mean(miss[known] ** 2) / scale))
    beyond = np.flatnonzero(known & (miss > LIMIT * contact))
    lines = ", ".join(str(cells.lines[row]) for row in beyond[:3]) + (", ..." if beyond.size > 3 else "")
    return MomentumCheck(
        n=int(known.sum()),
        rms=rms,
        n_violating=int(beyond.size),
        limit=LIMIT,
        inertia_factor=inertia_factor,
        suggested=_suggested(dv[:, known], ds[:, known], scale, rms) if rms > LIMIT else None,
        source=cells.name,
        systematic=_systematic(dv[:, known], ds[:, known], inertia_factor, scale),
        where=f"{cells.word}{'' if beyond.size == 1 else 's'} {lines}" if beyond.size else "",
        of_pair=of_pair,
    )


def _changes(before: Mapping[str, Any], after: Mapping[str, Array], tangential: Array) -> tuple[Array, Array]:
    """Return the changes of v_t and R Omega, (1 or 2, n): along x, and across where that was measured."""
    dv = [after["v_x"] - tangential]
    ds = [after["spin_y_after"] - before["spin_y"]]
    if "v_y" in after and "spin_x_after" in after:
        # an impact without the lateral pair is judged by the other alone
        both = ~np.isnan(after["v_y"] + after["spin_x_after"])
        dv.append(np.where(both, after["v_y"], 0.0))
        ds.append(np.where(both, after["spin_x_after"] - before["spin_x"], 0.0))
    return np.array(dv), np.array(ds)


def _suggested(dv: Array, ds: Array, scale: float, rms: float) -> float | None:
    """Return the J of the least squares of dv = J ds, if a body can have it and it explains the miss."""
    change = float(np.sum(ds**2))
    own = float(np.sum(dv * ds)) / change if change > 0 else 0.0
    if not 0.0 < own <= 1.0:
        return None
    left = float(np.sqrt(np.mean(np.sum((dv - own * ds) ** 2, axis=0)) / scale))
    return own if left <= _EXPLAINS * rms else None


def _systematic(dv: Array, ds: Array, inertia_factor: float, scale: float) -> float:
    """What of the miss a line in the change of spin takes, as `MomentumCheck` has it; of few impacts all."""
    from scipy import special  # commands that read no velocities start without it

    miss = dv - inertia_factor * ds
    n = miss.shape[1]
    if n < _MANY:
        return float(np.sqrt(np.sum(miss**2) / n / scale))
    found = 0.0
    for own, by in zip(miss, ds, strict=True):
        line = np.stack((np.ones(n), by), axis=1)
        fitted = line @ np.linalg.lstsq(line, own, rcond=None)[0]
        taken, left = float(fitted @ fitted), float((own - fitted) @ (own - fitted))
        if taken > 0.0 and special.fdtrc(2, n - 2, taken / 2.0 / max(left / (n - 2), 1e-300)) < _LOOKED_AT:
            found += taken
    return float(np.sqrt(found / n / scale))
