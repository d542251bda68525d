"""The paper's questions: open with stand-ins, answered by the same code once real points are installed."""

from __future__ import annotations

import numpy as np
import pytest
from factories import table_file

from ifrfit.data.catalogue import install
from ifrfit.paper.constants_table import OPEN, across_regimes, across_spins, reading
from ifrfit.paper.recovered_constants import CASES, case_named, fit_case
from ifrfit.physics import OBSERVABLES, rebound

ANGLES = np.arange(4.0, 86.0, 4.0)
TRUTH = {"e_n": 0.60, "e_t": -0.75, "mu": 0.15}


@pytest.fixture(autouse=True)
def own_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path / "own"))


def values(gamma, observable="beta", spin_y=0.0, **constants):
    r = rebound(gamma, spin_y=spin_y, degrees=True, **constants)
    return OBSERVABLES[observable].value(r, np.asarray(constants["mu"]))


def put(dataset, tmp_path, blocks, sigma=0.02):
    """Install simulated measurements: blocks of series, observable, spin, angles, values."""
    rng = np.random.default_rng(5)
    lines = ["series,observable,gamma_deg,spin_y,value,sigma,provenance"]
    for series, observable, spin, gamma, value in blocks:
        noisy = value + sigma * rng.standard_normal(gamma.size)
        lines += [
            f"{series},{observable},{g},{spin},{v},{sigma},measured"
            for g, v in zip(gamma, noisy, strict=True)
        ]
    path = tmp_path / "points.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    install(dataset, path)


def test_stand_ins_answer_nothing():
    done = {
        name: fit_case(case_named(name)) for name in ("cross-2019-no-spin", "cross-2019-spin", "buck-2017")
    }
    for found in done.values():
        assert across_regimes(found).verdict == OPEN
    assert across_spins(done).verdict == OPEN
    assert reading(done["buck-2017"]).verdict == OPEN
    assert OPEN == "not answerable until real points are installed"


def test_one_set_in_both_regimes_is_found_to_hold(tmp_path):
    put("hashemnia-2019", tmp_path, [("no spin", "beta", 0.0, ANGLES, values(ANGLES, **TRUTH))])
    answer = across_regimes(fit_case(case_named("hashemnia-2019")))
    assert answer.verdict == "yes, as far as these points tell"
    assert "both regimes" in answer.why
    assert "no lack of fit" in answer.why


def test_two_sets_are_found_out(tmp_path):
    """Control: sticking with one e_t, sliding with another."""
    one, other = ({"e_n": 0.60, "e_t": e_t, "mu": 0.15} for e_t in (-0.70, -0.85))
    beta = np.where(ANGLES < 30.96, values(ANGLES, **one), values(ANGLES, **other))
    put("hashemnia-2019", tmp_path, [("no spin", "beta", 0.0, ANGLES, beta)])
    assert across_regimes(fit_case(case_named("hashemnia-2019"))).verdict == "no"


def test_one_regime_alone_does_not_answer(tmp_path):
    gamma = np.arange(40.0, 86.0, 3.0)
    put("hashemnia-2019", tmp_path, [("no spin", "beta", 0.0, gamma, values(gamma, **TRUTH))])
    answer = across_regimes(fit_case(case_named("hashemnia-2019")))
    assert answer.verdict == "not answerable"
    assert answer.why == "all impacts slide, so one regime is seen only"


@pytest.mark.parametrize(
    ("mu_with_spin", "verdict"), [(0.12, "yes, as far as these points tell"), (0.14, "no")]
)
def test_one_mu_or_two_is_told_by_the_three_series(tmp_path, mu_with_spin, verdict):
    blocks = []
    for series, spin in (("no spin", 0.0), ("spin 0.225", 0.225), ("spin 0.833", 0.833)):
        truth = {"e_n": 0.94, "e_t": -0.98, "mu": 0.12 if spin == 0.0 else mu_with_spin}
        blocks.append((series, "beta", spin, ANGLES, values(ANGLES, spin_y=spin, **truth)))
    put("cross-2019", tmp_path, blocks)
    done = {name: fit_case(case_named(name)) for name in ("cross-2019-no-spin", "cross-2019-spin")}
    assert across_spins(done).verdict == verdict


@pytest.mark.parametrize(("really", "verdict"), [("beta", "yes"), ("beta_cm", "no")])
def test_the_printed_constants_tell_which_beta_fig_4a_shows(tmp_path, really, verdict):
    gamma = np.arange(10.0, 86.0, 5.0)
    truth = values(gamma, really, e_n=0.78, e_t=-0.80, mu=0.01)
    put("buck-2017", tmp_path, [("no spin", "beta", 0.0, gamma, truth)])
    answer = reading(fit_case(case_named("buck-2017")))
    assert answer.verdict == verdict
    assert "log evidence of free constants" in answer.why


def test_points_named_as_the_centres_are_taken_so(tmp_path):
    gamma = np.arange(10.0, 86.0, 5.0)
    truth = values(gamma, "beta_cm", e_n=0.78, e_t=-0.80, mu=0.01)
    put("buck-2017", tmp_path, [("no spin", "beta_cm", 0.0, gamma, truth)])
    done = fit_case(case_named("buck-2017"))
    assert set(done.result.points["observable"]) == {"beta_cm"}


def test_a_simulation_is_not_taken_for_an_experiment(tmp_path):
    columns = {"series": "no spin", "gamma_deg": ANGLES, "beta": values(ANGLES, **TRUTH), "sigma": 0.02}
    path = table_file(tmp_path / "simulated.csv", columns)
    install("hashemnia-2019", path, provenance="simulated")
    answer = across_regimes(fit_case(case_named("hashemnia-2019")))
    assert answer.verdict == "not answerable from a simulation"


def test_real_data_are_answered_today():
    near, oblique = (
        across_regimes(fit_case(case_named(n))) for n in ("kharaz-2001", "kharaz-2001-from-15-deg")
    )
    assert near.verdict == "no"
    assert "up to 4.22 degrees" in near.why
    assert oblique.verdict.startswith("yes")


def test_every_case_has_a_figure_of_the_paper_or_no_place_in_one():
    """Repeats have no angle to draw over, and of rocks that contradict the closure no curve is right."""
    assert [case.name for case in CASES if not case.figures] == ["wang-2018-limestone", "netl-glass-acrylic"]
