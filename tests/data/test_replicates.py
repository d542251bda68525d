"""Means of repeats carry their count and the standard error of their scatter."""

from __future__ import annotations

import numpy as np
import pytest

from ifrfit.data import average_replicates


def test_mean_count_and_standard_error(read):
    obs = average_replicates(read("gamma_deg,beta,sigma\n30,0.1,9\n30,0.2,9\n30,0.6,9\n40,0.5,0.05\n"))
    table = obs.table
    assert list(table.value) == pytest.approx([0.3, 0.5])
    assert table.sigma[0] == pytest.approx(np.std([0.1, 0.2, 0.6], ddof=1) / np.sqrt(3))
    assert table.sigma[1] == 0.05
    assert list(table.n_repeats) == [3, 1]
    assert list(table.row) == [2, 5]
    (source,) = obs.sources
    assert (source.rows, source.rows_used, source.rows_skipped) == (4, 2, {"averaged with repeats": 2})
    assert "3 repeated rows were averaged to 1 means" in obs.notes[-1]


@pytest.mark.parametrize(
    "column", ["series", "observable", "gamma_deg", "spin_x", "spin_y", "provenance", "impact_id"]
)
def test_settings_are_kept_apart(read, column):
    # readings of one impact may differ by so much
    others = {"observable": "beta_cm", "gamma_deg": "30.2", "provenance": "simulated"}
    other = others.get(column, "0.01" if column.startswith("spin") else "1")
    row = {"series": "s", "observable": "beta", "gamma_deg": "30", "spin_x": "0", "spin_y": "0"}
    row |= {"provenance": "measured", "impact_id": "i", "value": "0.2"}
    lines = [",".join(row), ",".join(row.values()), ",".join({**row, column: other}.values())]
    obs = read("\n".join(lines) + "\n")
    assert len(average_replicates(obs)) == 2
    assert average_replicates(obs).notes == ("No rows repeat one another: nothing was averaged.",)


def test_repeats_without_angle(read):
    table = average_replicates(read("e_n\n0.9\n0.8\n")).table
    assert table.value[0] == pytest.approx(0.85)
    assert table.n_repeats[0] == 2


def test_equal_values_have_no_known_uncertainty(read):
    table = average_replicates(read("gamma_deg,beta\n30,0.5\n30,0.5\n")).table
    assert np.isnan(table.sigma[0])


def test_impacts_are_averaged_on_request_and_stay_tied(read):
    obs = read("gamma_deg,beta_cm,e_n\n30,0.1,0.9\n30,0.3,0.7\n40,0.2,0.8\n")
    assert len(average_replicates(obs)) == 6
    table = average_replicates(obs, across_impacts=True).table
    assert list(table.value) == pytest.approx([0.2, 0.8, 0.2, 0.8])
    assert table.impact_id[0] == table.impact_id[1] != table.impact_id[2]


def test_means_of_means_are_weighted_by_their_counts(read):
    table = average_replicates(read("gamma_deg,beta,n\n30,0.1,1\n30,0.4,3\n")).table
    assert table.value[0] == pytest.approx(0.325)
    assert table.n_repeats[0] == 4


def test_the_standard_error_is_right_on_average(read):
    """Sigma^2 of the mean, over 400 settings of 5 repeats of sd 0.2: within 5 standard errors of 0.2^2/5."""
    rng = np.random.default_rng(3)
    rows = [
        f"{g:.4f},{v!r}" for g in np.linspace(1, 89, 400) for v in (0.2 * rng.standard_normal(5)).tolist()
    ]
    table = average_replicates(read("gamma_deg,beta\n" + "\n".join(rows) + "\n")).table
    expected = 0.2**2 / 5
    assert len(table) == 400
    assert np.mean(table.sigma**2) == pytest.approx(expected, abs=5 * expected * np.sqrt(2 / 4 / 400))
