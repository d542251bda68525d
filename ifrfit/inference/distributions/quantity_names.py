"""Names of the quantities of a distribution, and what is said of one that it does not have."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from ifrfit.errors import UnknownNameError, UsageError
from ifrfit.inference.model.entry_names import quantity_of
from ifrfit.text import joined, meant

_ASKED_BY_NAME = ("mean", "sd", "quantile", "cdf", "covariance")


class NamedQuantities:
    """A distribution whose methods, asked for a quantity that it does not have, say which there are."""

    if TYPE_CHECKING:

        @property
        def names(self) -> tuple[str, ...]:
            """Quantities that it has."""

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        for method in _ASKED_BY_NAME:
            if method in cls.__dict__:
                setattr(cls, method, _telling(cls.__dict__[method]))


def _telling(method: Callable[..., Any]) -> Callable[..., Any]:
    """The method, which names what there is where a name is unknown."""

    @wraps(method)
    def asked(self: NamedQuantities, name: Any, *choices: Any, **named: Any) -> Any:
        if method.__name__ == "quantile":
            _check_probability(*choices, **named)
        try:
            return method(self, name, *choices, **named)
        except (KeyError, ValueError):
            asked_for = [name] if isinstance(name, str) else list(name)
            unknown = [each for each in asked_for if each not in self.names]
            if not unknown:
                raise
            raise UnknownNameError(unknown_quantity(unknown[0], self.names)) from None

    return asked


def _check_probability(p: ArrayLike = 0.5) -> None:
    wrong = [each for each in np.asarray(p, dtype=float).ravel().tolist() if not 0.0 <= each <= 1.0]
    if wrong:
        raise UsageError(f"quantile: {wrong[0]:g} is no probability. Give p from 0 to 1, as 0.975.")


def unknown_quantity(name: str, names: Sequence[str]) -> str:
    """Sentences on a quantity that a distribution does not have.

    Parameters
    ----------
    name : str
    names : sequence of str
        Those that it has.
    """
    own = [each for each in names if quantity_of(each) == quantity_of(str(name))]
    if own:
        shared = own == [quantity_of(own[0])]
        hint = f" {own[0]} is the same in all series." if shared else f" Name one of {joined(own, 'or')}."
    else:
        hint = meant(str(name), names)
    return f"There is no quantity '{name}'. There are {joined(names)}.{hint}"
