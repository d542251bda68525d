"""The constants of a fit as one table: by name, by attribute, and as other libraries hold them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from ifrfit.errors import UnknownNameError, UsageError
from ifrfit.inference.model.entry_names import split_name
from ifrfit.inference.result.types import Constants, Estimate, by_entry
from ifrfit.text import joined, meant

if TYPE_CHECKING:
    import pandas as pd


class SeriesEstimates(dict[str, Estimate]):
    """A constant that each series has for itself: series to estimate.

    Parameters
    ----------
    name : str
        Of the constant.
    estimates : mapping of str to Estimate
    """

    def __init__(self, name: str, estimates: Mapping[str, Estimate]) -> None:
        super().__init__(estimates)
        self._name = name

    def __missing__(self, series: str) -> Estimate:
        raise UnknownNameError(
            f"There is no series '{series}' with a {self._name}. There are {joined(list(self))}."
            f"{meant(str(series), list(self))}"
        )

    def __getattr__(self, name: str) -> Estimate:
        if name.startswith("_"):
            raise AttributeError(name)
        first = next(iter(self), "")
        raise AttributeError(
            f"{self._name} is separate: each series has its own, of {joined(list(self))}. Take "
            f'constants.{self._name}["{first}"].{name}, say.'
        )

    def __format__(self, spec: str) -> str:
        """Every series with its estimate in this format."""
        return ", ".join(f"{series}: {estimate:{spec}}" for series, estimate in self.items())

    def __reduce__(self) -> tuple[type[SeriesEstimates], tuple[str, dict[str, Estimate]]]:
        return SeriesEstimates, (self._name, dict(self))


class ConstantsTable(Mapping[str, "Estimate | Mapping[str, Estimate]"]):
    """The constants of a fit: ``fit.constants.mu.value``, ``fit.constants["mu"]``, ``to_frame()``.

    A constant that is separate is a mapping of series to estimates.

    Parameters
    ----------
    constants : mapping of str to Estimate, or to mapping of str to Estimate
    """

    def __init__(self, constants: Constants) -> None:
        self._constants = {
            name: found if isinstance(found, Estimate) else SeriesEstimates(name, found)
            for name, found in constants.items()
        }

    def __getitem__(self, name: str) -> Estimate | Mapping[str, Estimate]:
        try:
            return self._constants[name]
        except KeyError:
            raise UnknownNameError(self._unknown(name)) from None

    def __getattr__(self, name: str) -> Estimate | Mapping[str, Estimate]:
        if name.startswith("_"):
            raise AttributeError(name)
        try:
            return self._constants[name]
        except KeyError:
            raise AttributeError(self._unknown(name)) from None

    def _unknown(self, name: str) -> str:
        names = list(self._constants)
        quantity, series = split_name(name)
        own = self._constants.get(quantity)
        if isinstance(own, SeriesEstimates):
            hint = f' Take constants.{quantity}["{series}"].'
        else:
            hint = meant(name, names)
        return f"There is no constant '{name}'. It has {joined(names)}.{hint}"

    def __iter__(self) -> Iterator[str]:
        return iter(self._constants)

    def __len__(self) -> int:
        return len(self._constants)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mapping) and self._constants == dict(other)

    __hash__ = None  # type: ignore[assignment]

    def __dir__(self) -> list[str]:
        return [*self._constants, "items", "keys", "to_frame", "values"]

    def __repr__(self) -> str:
        return f"ConstantsTable({', '.join(f'{name} {found}' for name, found in by_entry(self).items())})"

    def __str__(self) -> str:
        return str(self.to_frame().to_string(na_rep="-"))

    def _repr_html_(self) -> str:
        return str(self.to_frame().to_html(na_rep="-"))

    def to_frame(self) -> pd.DataFrame:
        """One row a constant, with its series in brackets where it is separate.

        Returns
        -------
        DataFrame
            Index constant; value, mean, stderr, lo68, hi68, lo95, hi95 (nan where there is none), status and
            reason.
        """
        import pandas as pd

        found = by_entry(self)
        table = pd.DataFrame(
            {
                "value": [each.value for each in found.values()],
                "mean": [each.mean for each in found.values()],
                "stderr": [each.stderr for each in found.values()],
                "lo68": [each.interval68[0] for each in found.values()],
                "hi68": [each.interval68[1] for each in found.values()],
                "lo95": [each.interval95[0] for each in found.values()],
                "hi95": [each.interval95[1] for each in found.values()],
            },
            index=pd.Index(list(found), name="constant"),
            dtype=float,
        )
        return table.assign(
            status=[each.status for each in found.values()], reason=[each.reason for each in found.values()]
        )


def with_uncertainties(constants: Constants, names: tuple[str, ...], matrix: object) -> dict[str, object]:
    """Constants as correlated numbers of the package ``uncertainties``.

    Parameters
    ----------
    constants : mapping
    names : tuple of str
        Of the free constants, with the series in brackets.
    matrix : ndarray, (names, names)
        Their correlation.

    Returns
    -------
    dict of str to uncertainties.UFloat or float
        A float for what is fixed. Intervals and bounds are lost: a linear law of propagation is all it knows.

    Raises
    ------
    UsageError
        For a constant without a value or without a standard deviation.
    """
    import numpy as np
    from uncertainties import correlated_values_norm

    found = by_entry(constants)
    open_ones = [name for name, each in found.items() if each.value is None]
    if open_ones:
        raise UsageError(
            f"{joined(open_ones)}: the data do not determine it, so that there is no value with an "
            "uncertainty. Take draws, or its interval."
        )
    free = [name for name in names if name in found and found[name].stderr]
    places = [names.index(name) for name in free]
    values = [(float(found[n].value or 0.0), float(found[n].stderr or 0.0)) for n in free]
    made = correlated_values_norm(values, np.asarray(matrix)[np.ix_(places, places)]) if free else ()
    numbers: dict[str, object] = {name: each.value for name, each in found.items()}
    return numbers | dict(zip(free, made, strict=True))
