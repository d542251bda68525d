"""Impacts on the fitted transition itself, where the last digit of an angle told whether they stick."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from streams import folder_of, impacts

import ifrfit
from ifrfit.physics.angles import Incidence
from ifrfit.physics.impulse_laws import impulse_factor

pytest.importorskip("numba")


def transition(fit):
    return next(iter(fit.derived["transition_angle_deg"].values())).value


def on_its_transition(n, seed, count):
    """A table of beta, some of whose impacts lie where its own fit has the transition, to the last digit."""
    table = impacts(n, seed, spin=0.0, columns=("beta",))
    fit = ifrfit.fit(table, method="lsq", fix={"e_n": 0.9})
    for _ in range(30):
        gamma = transition(fit)
        values = {name: one.value for name, one in fit.constants.items()}
        own = table.iloc[:count].assign(gamma_deg=gamma)
        own["beta"] = ifrfit.rebound(np.full(count, gamma), degrees=True, **values).beta
        whole = pd.concat([table, own], ignore_index=True)
        fit = ifrfit.fit(whole, method="lsq", fix={"e_n": 0.9})
        if transition(fit) == gamma:
            break
    return whole


@pytest.mark.parametrize(("n", "seed", "count"), [(133, 8, 2), (157, 14, 3), (92, 20, 1), (21, 22, 3)])
def test_uncertainties_are_those_in_memory(tmp_path, n, seed, count):
    """Of 60 such tables 13 had other standard deviations of e_t and mu, by up to a tenth."""
    table = on_its_transition(n, seed, count)
    streamed = ifrfit.fit(
        folder_of(tmp_path / "log", table, suffix="parquet"), method="lsq", fix={"e_n": 0.9}
    )
    held = ifrfit.fit(table, method="lsq", fix={"e_n": 0.9})
    for name in ("e_t", "mu"):
        ours, theirs = streamed.constants[name], held.constants[name]
        assert ours.value == pytest.approx(theirs.value, rel=1e-12)
        assert ours.stderr == pytest.approx(theirs.stderr, rel=1e-9)


@pytest.mark.parametrize("digits", [-4, -1, 0, 1, 4])
def test_the_last_digits_do_not_decide_whether_an_impact_sticks(digits):
    gamma = np.radians(np.linspace(1.0, 89.0, 50))
    tau = np.tan(gamma) * (1.0 + digits * np.finfo(float).eps)
    incidence = Incidence.of(np.degrees(np.arctan(tau)), degrees=True)
    for bound in (0.2, 0.5714):
        _, sticks = impulse_factor(incidence, 0.0, bound, bound * np.tan(gamma))
        assert sticks.all()
        for away in (1e-9, -1e-9):
            _, sticks = impulse_factor(incidence, 0.0, bound, bound * np.tan(gamma) * (1.0 + away))
            assert (sticks == (away > 0.0)).all()
