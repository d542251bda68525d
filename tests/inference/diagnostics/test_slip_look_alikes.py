"""What a slip is not told apart from is named beside it: inertia, spin before, a law of sticking."""

from __future__ import annotations

import pytest
from slips_scenes import Cause, Scene, experiment

from ifrfit.inference.fit import fit

HOLLOW = Cause("inertia-factor", 2.0 / 3.0)
OBSERVED = (("beta_cm", "e_n"), ("v_x", "v_n"), ("delta_deg", "e_n"), ("beta", "e_n"))


def hollow(names, seed, known=False):
    return experiment(Scene(names, 40, 0.01, known=known), HOLLOW, seed)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize("names", OBSERVED, ids=",".join)
def test_a_hollow_ball_is_named_without_spins(names, known):
    """Spin before, some -2/3 of pure rolling, gives the same numbers: both are named."""
    data = hollow(names, 1, known)
    slips = fit(data, method="lsq", independent=True).facts["slips"]
    assert slips.figures["called"][0] == "inertia-factor"
    assert "(thin hollow ball 0.6667)" in slips.says
    assert slips.says.endswith("--inertia-factor 0.6667")
    if "beta" not in names:
        assert "spin before impact that is not in it" in slips.says
    mended = fit(data, method="lsq", independent=True, inertia_factor=2.0 / 3.0)
    assert mended.facts["slips"].ok
    assert mended.facts["lack_of_fit"].ok


def test_a_law_of_sticking_stands_beside_an_inertia_factor():
    """Without spins beside velocities J is nothing but a law of sticking: of FR, too, IFR makes another J."""
    data = experiment(Scene(("beta_cm", "e_n"), 60, 0.01, closure="fr"), Cause(), 4)
    facts = fit(data, method="lsq", independent=True, closure="ifr").facts
    assert "inertia-factor" in facts["slips"].figures["called"]
    assert "another constant law of sticking" in facts["slips"].says
    assert "ifrfit compare tells closures from one another first" in facts["slips"].says
