"""Where steps that shrink by one ratio each would end (Aitken 1926)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ifrfit.inference.model.rows import Array, Index

_ALIGNED = 0.01  # share of a step, squared, that may lie across the one before where it goes on along it
_STEADY = 0.9  # ratio of steps whose end can be foreseen
_SHORT = 0.1  # longest entry of a step that is near its end
_FURTHER = 20.0  # times a step, at most, that it is made longer


def lengthening(step: Array, before: Array, moved: Array) -> Array:
    """How many times as long the next steps have to be to end, (m,); not a number where they turn.

    Parameters
    ----------
    step, before : ndarray, (m, q)
        What the rule of the iteration proposes now, and what it proposed last.
    moved : ndarray, (m, q)
        How far the iteration went last: `before`, or more.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        size = (before**2).sum(axis=1)
        ratio = (step * before).sum(axis=1) / size
        across = ((step - ratio[:, None] * before) ** 2).sum(axis=1)
        factor = (moved * before).sum(axis=1) / size / (1.0 - ratio)
        return np.where(across <= _ALIGNED * (step**2).sum(axis=1), factor, np.nan)


def end_of_steps(before: Array, step: Array) -> Array | None:
    """What is left after a step, (q,), that follows the one before it; None where it cannot be told."""
    (factor,) = lengthening(step[None], before[None], before[None])
    if not abs(1.0 - 1.0 / factor) <= _STEADY or np.abs(step).max() > _SHORT:
        return None
    return np.asarray((factor - 1.0) * step)


@dataclass(frozen=True)
class StepsBefore:
    """The last step of the model of each search, and how far it went, (m, q) each.

    Where residuals are large, steps of Gauss and Newton shrink by one ratio each. Where the next one goes on
    along the last, it is as long as the line through the two leads to no step at all (Aitken).
    """

    step: Array
    moved: Array

    @classmethod
    def none(cls, m: int, q: int) -> StepsBefore:
        """Before the first steps."""
        return cls(np.zeros((m, q)), np.zeros((m, q)))

    def keep(self, which: Index, step: Array, moved: Array) -> None:
        """The steps of some searches."""
        self.step[which], self.moved[which] = step, moved

    def factor(self, which: Index, step: Array, unit: Array) -> Array:
        """By which the next steps of some searches are to be longer, (m,); 1 where nothing is known."""
        scale = np.where(unit > 0.0, 1.0 / np.where(unit > 0.0, unit, 1.0), 0.0)
        factor = lengthening(step * scale, self.step[which] * scale, self.moved[which] * scale)
        return np.where((factor > 0.0) & (factor < _FURTHER), factor, 1.0)
