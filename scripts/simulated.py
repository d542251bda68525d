"""Simulated rows as observations."""

from __future__ import annotations

from numpy.typing import ArrayLike

from ifrfit.data.observations import Observations, make_table


def simulated(
    observable: ArrayLike, gamma_deg: ArrayLike, value: ArrayLike, sigma: ArrayLike, series: ArrayLike = "run"
) -> Observations:
    """Observations of values; a name or a sigma alone holds for all rows."""
    columns = {"series": series, "observable": observable, "gamma_deg": gamma_deg, "value": value}
    return Observations(make_table({**columns, "sigma": sigma, "provenance": "simulated"}))
