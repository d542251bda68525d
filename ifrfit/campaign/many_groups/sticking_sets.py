"""chi2 of many groups for each set of impacts that may stick: quadratics in the closure constant and kappa.

With a closure whose transition does not depend on its constant, kappa alone decides which impacts slide: in
the order of tau the first k stick. So a group of n values has n + 1 such sets, between walls of kappa at each
measured tau, and chi2 is a quadratic in each. Its least value over all of them is the certified optimum; it
lies inside a set, on a wall, where an impact is on the transition, or at an end of the constant's domain.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ifrfit.campaign.many_groups.of_groups import OfGroups
from ifrfit.campaign.many_groups.values import Tangential
from ifrfit.inference.optimize.branch_and_bound import MOST_NEAR
from ifrfit.inference.optimize.piecewise import CHI2_95, NEAR
from ifrfit.inference.optimize.transition_cells import N_BELOW, SIZE, quadratic_matrix
from ifrfit.physics.impulse_laws import ROUNDING, Coefficients

Array = NDArray[np.float64]
Bool = NDArray[np.bool_]
Index = NDArray[np.intp]

_SINGULAR = 1e-10  # of the determinant over the product of the diagonal
_ILL = 1e-4  # of the same: below, as where all impacts slide at one angle, chi2 is a valley with a flat floor
_DIGITS = 1e-6  # relative, of what counts as a rival: what lies nearer to it counts perhaps
_AS_GOOD = 2e-6  # of chi2 within which the general search takes two minima for equally good, and a little
_ROUNDED = 8.0 * np.finfo(float).eps  # of the sums that chi2 is made of
_ON = 1e-9  # relative, of what lies on a wall
_SAME = 1e-5  # of chi2 within which two optima are as good
_ONE_PLACE = 1.1 * _SAME**0.5  # sd within which both are of one valley, whose parabola has that rise
_NO_WIDTH = 1e-6  # what stands for that where the data leave the place open


@dataclass(frozen=True)
class StickingSets(OfGroups):
    """The quadratics in (c, kappa) of each set of impacts that may stick: the first k by tau, k = 0, 1, ...

    Attributes
    ----------
    walls : ndarray, (groups, most + 2)
        kappa between the sets, from 0 to infinity.
    count : ndarray of int, (groups,)
    forms : ndarray, (groups, 6, most + 1)
        chi2 = f0 + f1 c + f2 kappa + f3 c^2 + f4 c kappa + f5 kappa^2.
    """

    walls: Array
    count: Index
    forms: Array

    @classmethod
    def of(cls, rows: Tangential, law: Coefficients) -> StickingSets:
        """From the values of the groups; `law` with b1 = 0."""
        tau, z, w = rows.tau, rows.factor, rows.weight
        x = 1.0 / tau
        terms = np.stack((w, w * z, w * z * z, w * x, w * x * x, w * z * x))  # as `row_products` has them
        none = np.zeros((*terms.shape[:2], 1))
        # not as what is left of all: where 1/tau is large the difference would lose its digits
        above = np.cumsum(terms[..., ::-1], axis=2)[..., ::-1]
        below = np.concatenate((none[:N_BELOW], np.cumsum(terms[:N_BELOW], axis=2)), axis=2)
        sums = np.concatenate((below, np.concatenate((above, none), axis=2)))
        # no product of BLAS, whose threads would spin beside the other workers
        cc, ck, kk, c, k, one = np.einsum("ij,j...->i...", quadratic_matrix(law)[:SIZE], sums)
        forms = np.stack((one, -2.0 * c, -2.0 * k, cc, 2.0 * ck, kk), axis=1)
        edge = np.zeros((tau.shape[0], 1))
        walls = np.concatenate((edge, law.b0 * tau, edge + np.inf), axis=1)
        return cls(walls, np.isfinite(tau).sum(axis=1), forms)

    @property
    def coefficients(self) -> Array:
        """f0 to f5, (6, groups, most + 1)."""
        return self.forms.swapaxes(0, 1)

    def at(self, kappa: Array, domain: tuple[float, float]) -> Array:
        """Least chi2 over the closure constant in each set, at a kappa for each, (groups, most + 1)."""
        f0, f1, f2, f3, f4, f5 = self.coefficients
        own = self.constant(kappa, domain)
        return np.asarray(f0 + f1 * own + f2 * kappa + f3 * own**2 + f4 * own * kappa + f5 * kappa**2)

    def constant(self, kappa: Array, domain: tuple[float, float]) -> Array:
        """The closure constant that is best at a kappa for each set, (groups, most + 1)."""
        _, f1, _, f3, f4, _ = self.coefficients
        return np.asarray(np.clip(-(f1 + f4 * kappa) / (2.0 * f3), *domain))

    def minima(self, domain: tuple[float, float]) -> GroupOptima:
        """The least chi2 of each set, with the closure constant in its domain, and the least of all."""
        f0, f1, f2, f3, f4, f5 = self.coefficients
        low, high = self.walls[:, :-1], self.walls[:, 1:]
        there = np.arange(low.shape[1]) <= self.count[:, None]
        det = 4.0 * f3 * f5 - f4 * f4
        c, inner = (f4 * f2 - 2.0 * f5 * f1) / det, (f4 * f1 - 2.0 * f3 * f2) / det
        inside = (inner > low) & (inner < high) & (c > domain[0]) & (c < domain[1])
        inside &= det > _SINGULAR * 4.0 * f3 * f5
        least = np.where(inside, f0 + 0.5 * (f1 * c + f2 * inner), np.inf)
        kappa = np.where(inside, inner, low)
        above = np.where(np.isfinite(high), high, low)
        tried = [low, above]  # and along the ends of the domain
        for own in domain:
            along = np.clip(-(f2 + f4 * own) / (2.0 * f5), low, above)
            tried.append(np.where(np.isfinite(along), along, low))
        for place in tried:
            other = self.at(place, domain)
            least, kappa = np.minimum(least, other), np.where(other < least, place, kappa)
        return GroupOptima.of(self, np.where(there, least, np.inf), kappa, domain)


@dataclass(frozen=True)
class GroupOptima(OfGroups):
    """The best of all sets of each group, and the least of each set.

    Attributes
    ----------
    chi2, kappa, constant : ndarray, (groups,)
        The least of all, and where it is.
    sliding : ndarray of int, (groups,)
        How many impacts slide there; one on the transition itself sticks.
    kappa_variance, constant_variance : ndarray, (groups,)
        By the curvature there, before anything is cut; infinite where the data leave it open.
    beyond : ndarray, (groups,)
        How far the constant, were it free, would lie outside its domain there, in sd given kappa.
    rivals : ndarray, (groups, 2, 2)
        How far, at least and at most, kappa and the closure constant of the outermost sets lie from it that
        describe the data nearly as well. Infinite for kappa where that is so of the set in which every
        impact sticks.
    is_unique : ndarray of bool, (groups,)
        Whether no other optimum is as good, nor a whole valley.
    least, places : ndarray, (groups, most + 1)
        The least of each set, and its kappa.
    """

    chi2: Array
    kappa: Array
    constant: Array
    sliding: Index
    kappa_variance: Array
    constant_variance: Array
    beyond: Array
    rivals: Array
    is_unique: Bool
    least: Array
    places: Array

    @classmethod
    def of(cls, sets: StickingSets, least: Array, places: Array, domain: tuple[float, float]) -> GroupOptima:
        """From the least of each set."""
        groups = np.arange(least.shape[0])
        chi2, best = least.min(axis=1), least.argmin(axis=1)
        constants = sets.constant(places, domain)
        kappa, own = places[groups, best], constants[groups, best]
        # what is on the transition itself sticks
        sticking = (sets.walls[:, 1:-1] <= kappa[:, None] * (1.0 + ROUNDING)).sum(axis=1)
        f1, _, f3, f4, f5 = sets.coefficients[1:, groups, sticking]
        free = -(f1 + f4 * kappa) / (2.0 * f3)
        det = f3 * f5 - 0.25 * f4**2
        seen = det > _SINGULAR * f3 * f5
        rise = least - chi2[:, None]

        def distances(near: Bool) -> Array:
            """Of kappa and the constant, (2, groups): how far the outermost of some sets lie."""
            ends = near.argmax(axis=1), near.shape[1] - 1 - near[:, ::-1].argmax(axis=1)
            found = [
                np.maximum(*(np.abs(each[groups, end] - at) for end in ends))
                for each, at in ((places, kappa), (constants, own))
            ]
            # where every impact sticks kappa has no upper end
            found[0] = np.where(near[groups, sets.count], np.inf, found[0])
            return np.array(found)

        a, b, c = sets.coefficients[3:]
        slides = np.arange(least.shape[1]) < sets.count[:, None]
        is_valley = (slides & (rise <= NEAR) & (4.0 * a * c - b * b < _ILL * 4.0 * a * c)).any(axis=1)
        every_sticks, same = sticking >= sets.count, distances(rise <= _SAME)
        variances = np.where(seen, [f3 / det, f5 / det], np.inf)
        one_place = np.where(seen, _ONE_PLACE * np.sqrt(variances), _NO_WIDTH)
        variances[1] = np.where(seen | ~every_sticks, variances[1], 1.0 / f3)
        is_one = same < one_place
        # another local minimum, as good as the general search counts them
        as_good = _is_minimum(sets, places) & (rise <= _AS_GOOD)
        lowest, highest = (
            np.where(as_good, places, np.inf).min(axis=1),
            np.where(as_good, places, 0.0).max(axis=1),
        )
        is_one &= highest - lowest <= _ON * highest
        # rounding may tell on which side of a wall it is
        rounded = _ROUNDED * np.abs(sets.coefficients[0]).max(axis=1)
        away = np.abs(sets.walls[:, 1:-1] - kappa[:, None]).min(axis=1)
        is_one &= np.where(away <= _ON * kappa, rounded < _AS_GOOD, away**2 > rounded * variances[0])
        return cls(
            chi2=chi2,
            kappa=kappa,
            constant=own,
            sliding=sets.count - sticking,
            kappa_variance=variances[0],
            constant_variance=variances[1],
            beyond=np.maximum(domain[0] - free, free - domain[1]) * np.sqrt(f3),
            rivals=np.stack([distances(near).T for near in _rivals(sets, rise, places)], axis=1),
            is_unique=~is_valley & is_one[1] & (every_sticks | is_one[0]),
            least=least,
            places=places,
        )


def _is_minimum(sets: StickingSets, places: Array) -> Bool:
    """Whether the least of each set is a local minimum of all: inside, or on a wall and of both its sides."""
    low, high = sets.walls[:, :-1], sets.walls[:, 1:]
    on_low, on_high = (np.abs(places - wall) <= _ON * wall for wall in (low, high))
    found = ~on_low & ~on_high
    kink = on_high[:, :-1] & on_low[:, 1:]
    found[:, :-1] |= kink
    found[:, 1:] |= kink
    return found


def _rivals(sets: StickingSets, rise: Array, places: Array) -> tuple[Bool, Bool]:
    """Which sets describe the data nearly as well, (groups, most + 1) each: surely, and perhaps.

    Those within a 95 % interval of the best, and local minima a little above it, as the search of one group
    counts them: `ifrfit.inference.optimize.solved_cells.local_minima`.
    """
    low, high = sets.walls[:, :-1], sets.walls[:, 1:]
    beside_low, beside_high = (np.abs(places - wall) <= _DIGITS * wall for wall in (low, high))
    none = np.full((rise.shape[0], 1), np.inf)
    below = np.concatenate((none, rise[:, :-1]), axis=1) < rise - _DIGITS
    above = np.concatenate((rise[:, 1:], none), axis=1) < rise - _DIGITS
    no_minimum = (beside_low & below) | (beside_high & above)
    is_minimum = (places > low) & ~beside_low & ~beside_high
    # of more sets the search of one group looks at no more than runs of them
    is_counted = (sets.count < MOST_NEAR)[:, None]
    surely = rise <= np.where(is_counted & is_minimum, NEAR, CHI2_95) * (1.0 - _DIGITS)
    perhaps = rise <= np.where(is_counted & no_minimum, CHI2_95, NEAR) * (1.0 + _DIGITS)
    return surely, perhaps
