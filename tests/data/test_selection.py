"""Rows are chosen as asked, and no impact is counted twice."""

from __future__ import annotations

import numpy as np
import pytest
from refusals import refused

from ifrfit.data import Descriptor, Observations, Selection, Source, combine, read, select
from ifrfit.data.observations import make_table
from ifrfit.errors import DataError, UsageError

TWICE = "same impacts counted already"


def obs_of(rows, *, name="a.csv", faces=(), series=(), observables=(), **columns):
    """Observations from (observable, series, impact_id) rows; row numbers begin at 2."""
    names, labels, ids = zip(*rows, strict=True)
    n = len(rows)
    full = {
        "value": np.linspace(0.1, 0.2, n),
        "observable": list(names),
        "series": list(labels),
        "impact_id": list(ids),
        "gamma_deg": np.linspace(10, 80, n),
        "row": np.arange(2, n + 2),
        "source": name,
        **columns,
    }
    descriptor = None
    if faces or series or observables:
        descriptor = Descriptor(
            name, "", "measured", faces=faces, default_series=series, default_observables=observables
        )
    return Observations(make_table(full), (Source(name, name, n, n, {}, "", "", descriptor),))


def used(obs):
    return list(obs.table.observable)


def of_one_impact(*names):
    return obs_of([(name, "s", "i") for name in names])


def test_nothing_chosen_nothing_lost():
    obs = obs_of([("beta", "s", ""), ("beta", "t", ""), ("e_n", "s", "")])
    chosen = select(obs, Selection())
    assert len(chosen) == 3
    assert chosen.notes == ()
    assert chosen.sources == obs.sources


@pytest.mark.parametrize(
    ("selection", "rows"),
    [
        (Selection(observable=("e_n",)), [4]),
        (Selection(series=("t",)), [3, 4]),
        (Selection(gamma_min=40.0), [4, 5]),
        (Selection(gamma_max=40.0), [2, 3, 5]),
        (Selection(gamma_min=33.0, gamma_max=57.0), [3, 4, 5]),
        (Selection(speed_min=2.0), [3, 4]),
        (Selection(speed_max=2.0), [2, 3]),
        (Selection(exclude=(3, "4")), [2, 5]),
        (Selection(exclude=("a.csv:3",)), [2, 4, 5]),
        (Selection(exclude=("some/folder/a.csv:3",)), [2, 4, 5]),
        (Selection(exclude=("drop 1",)), [2, 4, 5]),
        (Selection(exclude=("id:drop 1", 5)), [2, 4]),
    ],
)
def test_filters(selection, rows):
    obs = obs_of(
        [("beta", "s", ""), ("beta", "t", "drop 1"), ("e_n", "t", ""), ("e_n", "u", "")],
        gamma_deg=[10, 40 - 1e-9 - 5, 50, np.nan],
        speed_m_s=[1, 2, 3, np.nan],
    )
    if selection.observable == ("e_n",):
        rows = [4, 5]
    chosen = select(obs, selection)
    assert list(chosen.table.row) == rows
    source = chosen.sources[0]
    assert source.rows_used == len(rows)
    assert source.rows == 4 == source.rows_used + sum(source.rows_skipped.values())
    assert source.selection


def test_reasons_are_counted():
    obs = obs_of([("beta", "s", "")] * 5, gamma_deg=[10, 20, 30, 40, 50], speed_m_s=[1, 1, 9, np.nan, 1])
    chosen = select(obs, Selection(gamma_min=15, speed_max=5, exclude=(6,)))
    assert dict(chosen.sources[0].rows_skipped) == {
        "outside gamma range": 1,
        "outside speed range": 1,
        "no speed given": 1,
        "excluded": 1,
    }
    assert chosen.sources[0].selection == (
        "observable beta; series s; gamma from 15 degrees; speed up to 5 m/s; without 6"
    )


@pytest.mark.parametrize(
    ("names", "kept"),
    [
        (["beta", "beta_cm", "e_n", "spin_y_after"], ["beta_cm", "e_n", "spin_y_after"]),
        (["v_x", "v_y", "v_n", "spin_y_after", "spin_x_after"], None),
        (["beta_cm", "v_x"], ["v_x"]),
        (["e_n", "v_n"], ["v_n"]),
        (["mu_app", "tan_psi_after", "beta"], ["beta"]),
        (["mu_app", "tan_psi_after"], ["tan_psi_after"]),
        (["beta_tot", "mu_app"], ["mu_app"]),
        (["delta_deg", "lambda_deg"], ["delta_deg"]),
        (["beta", "e_n"], None),
        (["mu", "beta", "e_n"], None),
        (["beta", "beta"], ["beta"]),
        (["psi_out_deg", "psi_after_deg", "tan_psi_after", "tan_psi_out"], ["tan_psi_after"]),
    ],
)
def test_each_measurement_of_an_impact_counts_once(names, kept):
    chosen = select(of_one_impact(*names), Selection())
    assert sorted(used(chosen)) == sorted(kept or names)
    lost = len(names) - len(chosen)
    assert chosen.sources[0].rows_skipped.get(TWICE, 0) == lost
    assert bool(chosen.notes) == bool(lost)


def test_the_note_says_what_was_used_and_left_out():
    (note,) = select(of_one_impact("beta", "beta_cm"), Selection()).notes
    assert note == (
        "a.csv: beta_cm used, beta left out (1 row): they are of the same impacts and would count them "
        "twice. --observable or --series chooses otherwise."
    )


def test_impacts_are_judged_one_by_one_and_sources_apart():
    a = obs_of([("beta", "s", "1"), ("beta_cm", "s", "1"), ("beta", "s", "2"), ("beta", "s", "")])
    b = obs_of([("beta", "s", "1")], name="b.csv")
    chosen = select(combine([a, b]), Selection())
    assert used(chosen) == ["beta_cm", "beta", "beta", "beta"]
    assert [s.rows_used for s in chosen.sources] == [3, 1]


def test_without_links_nothing_is_dropped():
    assert len(select(obs_of([("beta", "s", ""), ("beta_cm", "s", "")]), Selection())) == 2


def test_what_the_user_names_is_used_instead():
    assert used(select(of_one_impact("beta", "beta_cm"), Selection(observable=("beta",)))) == ["beta"]


def test_naming_a_conflict_is_refused_unless_independent():
    obs = of_one_impact("beta", "beta_cm", "e_n")
    with refused(UsageError) as caught:
        select(obs, Selection(observable=("beta", "beta_cm")))
    assert caught.value.in_shell == (
        "--observable beta beta_cm: beta and beta_cm are of the same impacts (a.csv:3, for one) and "
        "would count them twice. Name one of them, or say --independent if they were measured independently."
    )
    chosen = select(obs, Selection(observable=("beta", "beta_cm"), independent=True))
    assert len(chosen) == 2
    assert "taken as independent" in chosen.sources[0].selection


def test_naming_what_does_not_conflict_is_fine():
    chosen = select(of_one_impact("beta", "beta_cm", "e_n"), Selection(observable=("beta", "e_n")))
    assert sorted(used(chosen)) == ["beta", "e_n"]


def test_correlated_errors_are_said():
    chosen = select(of_one_impact("mu_app", "e_n"), Selection())
    assert len(chosen) == 2
    assert (
        "mu_app is computed with the normal velocity that e_n gives for the same impacts" in chosen.notes[0]
    )
    assert select(obs_of([("mu_app", "s", "1"), ("e_n", "s", "2")]), Selection()).notes == ()


READINGS = [
    ("beta_cm", "one", ""),
    ("spin_y_after", "one", ""),
    ("psi_out_deg", "one", ""),
    ("beta_cm", "two", ""),
    ("spin_y_after", "two", ""),
    ("e_n", "drop", ""),
]


def test_faces_and_repeat_readings_of_a_descriptor_count_once():
    obs = obs_of(READINGS, faces=(("one", "two"),))
    chosen = select(obs, Selection())
    assert list(zip(chosen.table.observable, chosen.table.series, strict=True)) == [
        ("beta_cm", "one"),
        ("spin_y_after", "one"),
        ("e_n", "drop"),
    ]
    assert chosen.sources[0].rows_skipped[TWICE] == 3
    assert "psi_out_deg of one" in chosen.notes[0]


def test_naming_two_readings_is_refused_naming_one_is_not():
    obs = obs_of(READINGS, faces=(("one", "two"),))
    assert used(select(obs, Selection(series=("two",)))) == ["beta_cm", "spin_y_after"]
    with refused(UsageError, match=r"--series one two: one and two are of the same impacts"):
        select(obs, Selection(series=("one", "two")))
    assert len(select(obs, Selection(series=("one", "two"), independent=True))) == 5
    chosen = select(obs, Selection(observable=("beta_cm", "spin_y_after")))
    assert set(chosen.table.series) == {"one"}


def test_default_selection_of_a_descriptor():
    obs = obs_of(READINGS, faces=(("one", "two"),), series=("two",), observables=("beta_cm",))
    chosen = select(obs, Selection())
    assert list(zip(chosen.table.observable, chosen.table.series, strict=True)) == [("beta_cm", "two")]
    assert chosen.sources[0].rows_skipped == {"not selected": 5}
    assert any("by default only two is used, one, drop left out" in note for note in chosen.notes)
    other = select(obs, Selection(observable=("psi_out_deg",)))
    assert list(zip(other.table.observable, other.table.series, strict=True)) == [("psi_out_deg", "one")]
    assert set(select(obs, Selection(series=("one",))).table.series) == {"one"}


def test_default_selection_gives_way_where_it_would_leave_nothing():
    obs = obs_of(READINGS, series=("two",), observables=("beta_cm",))
    assert used(select(obs, Selection(series=("drop",)))) == ["e_n"]


def test_selecting_twice_changes_nothing_more():
    once = select(of_one_impact("beta", "beta_cm"), Selection(observable=("beta",)))
    again = select(once, Selection(observable=("beta",)))
    assert again.sources == once.sources
    assert used(again) == ["beta"]


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        (Selection(observable=("betta",)), r"--observable betta: not in the data\. There is beta, e_n\."),
        (Selection(observable=("mu_app",)), "It is known, but not among these data"),
        (Selection(series=("x",)), r"--series x: not in the data\. There is s\."),
        (Selection(gamma_min=5, gamma_max=4), "--gamma-min 5 is above --gamma-max 4"),
        (Selection(speed_min=5, speed_max=4), "--speed-min 5 is above --speed-max 4"),
        (Selection(gamma_min=float("nan")), "need numbers, not nan"),
        (Selection(exclude=(99,)), "--exclude 99: names no row and no impact of the data"),
        (Selection(exclude=("b.csv:2",)), "--exclude b.csv:2: names no row"),
        (
            Selection(exclude=(3,)),
            r"could be line 3 or the impact called 3\. Write a\.csv:3 for the line, id:3",
        ),
    ],
)
def test_usage_errors(selection, message):
    obs = obs_of([("beta", "s", "3"), ("e_n", "s", "1")])
    with refused(UsageError, match=message):
        select(obs, selection)


def test_a_line_number_in_two_files_is_ambiguous():
    both = combine([obs_of([("beta", "s", "")]), obs_of([("beta", "s", "")], name="b.csv")])
    with refused(UsageError, match=r"there is a line 2 in a\.csv and in b\.csv\. Write a\.csv:2\."):
        select(both, Selection(exclude=(2,)))
    assert list(select(both, Selection(exclude=("b.csv:2",))).table.source) == ["a.csv"]


@pytest.mark.parametrize(
    ("selection", "message"),
    [
        (Selection(gamma_min=85), r"Removed by the angle range \(from 85 degrees\) \(2 rows\); choose"),
        (Selection(speed_min=1), r"the speed range \(from 1 m/s\), as the speed is not given"),
        (Selection(exclude=(2, 3)), r"Removed by --exclude \(2 rows\)"),
        (Selection(observable=("beta",), series=("t",)), "--observable and --series together"),
    ],
)
def test_nothing_left(selection, message):
    obs = obs_of([("beta", "s", ""), ("beta_cm", "t", "")])
    with refused(DataError, match=message):
        select(obs, selection)


def test_a_wide_file_end_to_end(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text("gamma_deg,beta,beta_cm,e_n\n10,0.4,0.3,0.9\n20,0.4,,0.9\n")
    chosen = select(read(path), Selection())
    assert used(chosen) == ["beta_cm", "e_n", "beta", "e_n"]
    source = chosen.sources[0]
    assert source.rows == 6 == source.rows_used + sum(source.rows_skipped.values())
    assert dict(source.rows_skipped) == {"not measured": 1, TWICE: 1}
