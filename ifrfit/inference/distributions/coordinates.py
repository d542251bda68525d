"""The coordinates in which least squares is nearly Gaussian: kappa = mu (1 + e_n) in the place of mu.

Coordinates go by name (e_n, e_t, kappa; with a series in brackets where separate), because a result that was
read from a file knows no more.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.inference.model.entry_names import entry_name, name_in, quantity_of, split_name

Array = NDArray[np.float64]


def to_parameters(names: tuple[str, ...], phi: Array) -> dict[str, Array]:
    """Every parameter and kappa from their coordinates.

    Parameters
    ----------
    names : tuple of str
        Of the coordinates.
    phi : ndarray, (n, p)

    Returns
    -------
    dict
        Name to values, (n,): the parameters in the order of the coordinates, then kappa. Where one mu goes
        with several e_n each series has its kappa.
    """
    parameters: dict[str, Array] = {}
    kappas: dict[str, Array] = {}
    for name, column in zip(names, phi.T, strict=True):
        kind, series = split_name(name)
        if kind == "kappa":
            e_n = phi[:, names.index(name_in(names, "e_n", series))]
            kappas[name] = column
            parameters[entry_name("mu", series)] = column / (1.0 + e_n)
        else:
            parameters[name] = column
    for name in (name for name in names if quantity_of(name) == "e_n" and "mu" in names):
        kappas[entry_name("kappa", split_name(name)[1])] = parameters["mu"] * (1.0 + parameters[name])
    return parameters | kappas
