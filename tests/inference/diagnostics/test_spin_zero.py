"""Spins before impact whose zero is off: named where the data show it, and said how far it would move mu."""

from __future__ import annotations

import re

import numpy as np
import pandas as pd
import pytest
from factories import each_once, table_file

from ifrfit import fit, rebound

NOISE = {"beta": 0.02, "beta_cm": 0.02}


def table(zero: float, names: tuple[str, ...], seed: int) -> pd.DataFrame:
    """60 impacts with spins of up to 0.4 either way, all of which the table has lower by `zero`."""
    rng = np.random.default_rng([seed, 3])
    gamma, spin = np.sort(rng.uniform(5.0, 80.0, 60)), rng.uniform(-0.4, 0.4, 60)
    state = rebound(gamma, 0.0, spin, e_n=0.9, e_t=-0.9, mu=0.15, degrees=True)
    columns = {"gamma_deg": gamma, "spin_y": spin - zero}
    for name in names:
        exact = np.full(60, 0.9) if name == "e_n" else getattr(state, name.removesuffix("_after"))
        columns[name] = exact + NOISE.get(name, 0.01) * rng.standard_normal(60)
    return pd.DataFrame(columns)


def fitted(folder, data: pd.DataFrame):
    path = table_file(folder / "impacts.csv", data)
    return fit(path, method="lsq", **({"fix": {"e_n": 0.9}} if list(data)[2:] == ["beta"] else {}))


@pytest.mark.parametrize(
    ("zero", "names"), each_once([0.05, -0.08], [("beta_cm", "e_n"), ("v_x", "v_n", "spin_y_after")])
)
def test_the_zero_is_named_with_its_size(tmp_path, names, zero):
    for seed in range(3):
        slips = fitted(tmp_path, table(zero, names, seed)).facts["slips"]
        assert slips.figures["called"][0] == "spin-zero"
        size, sd = re.search(r"larger by (-?[\d.]+) \+- ([\d.]+)", slips.says).groups()
        assert abs(float(size) - zero) < 4.0 * float(sd)
        assert float(sd) < 0.25 * abs(zero)


def test_the_values_with_the_zero_put_right_pass(tmp_path):
    data = table(0.08, ("beta_cm", "e_n"), 1)
    assert not fitted(tmp_path, data).facts["slips"].ok
    assert fitted(tmp_path, data.assign(spin_y=data["spin_y"] + 0.08)).facts["slips"].ok


def test_spins_that_are_right_have_no_zero_to_mend(tmp_path):
    for seed in range(6):
        assert fitted(tmp_path, table(0.0, ("beta_cm", "e_n"), seed)).facts["slips"].ok


def test_what_the_data_hardly_show_is_assumed(tmp_path):
    result = fitted(tmp_path, table(0.03, ("beta",), 1))
    assert result.facts["slips"].ok
    (said,) = [words for words in result.assumed if words.startswith("spins before impact without an offset")]
    moved, in_sd = map(float, re.search(r"0\.02 would move mu by ([\d.]+), ([\d.]+) sd", said).groups())
    mu = result.constants["mu"]
    assert in_sd == pytest.approx(moved / mu.stderr, rel=0.02)
    # a zero that is off by 0.03 moved it by half as much again
    assert abs(mu.value - 0.15) == pytest.approx(1.5 * moved, abs=4.0 * mu.stderr)
