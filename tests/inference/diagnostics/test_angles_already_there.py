"""No other angles are asked for where all are there."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit import fit, rebound


def fitted(folder, gamma, noise, divided=None, mu=0.15):
    rng = np.random.default_rng(1)
    state = rebound(gamma, e_n=0.9, e_t=-0.7, mu=mu, degrees=True)
    by = np.ones(gamma.size) if divided is None else divided(np.radians(gamma))
    columns = {
        "gamma_deg": gamma,
        "v_x": (state.v_x + noise * rng.standard_normal(gamma.size)) / by,
        "v_n": (state.v_n + 0.01 * rng.standard_normal(gamma.size)) / by,
        "spin_y_after": (state.spin_y + noise * rng.standard_normal(gamma.size)) / by,
    }
    return fit(table_file(folder / "t.csv", columns), method="lsq")


@pytest.mark.parametrize(
    ("last", "noise", "divided", "mu", "says"),
    [
        (80.0, 0.02, np.cos, 0.15, "see first why the law does not describe them"),
        (80.0, 0.6, None, 0.15, "more impacts or smaller errors would tell"),
        (60.0, 0.02, None, 0.9, "measure beyond 60 degrees"),
    ],
)
def test_what_to_do_beside_the_angles(tmp_path, last, noise, divided, mu, says):
    found = fitted(tmp_path, np.linspace(8.0, last, 30), noise, divided, mu)
    fact = found.facts["identifiable"]
    assert not fact.ok
    assert says in fact.says
    if last == 80.0:
        assert "from 8 to 80 degrees are there already" in fact.says
        assert "other angles" not in fact.says
