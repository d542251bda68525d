"""Which observables and columns of a table are used: by its columns alone, without a file."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from refusals import refused

from ifrfit.data.cell_table import Cells
from ifrfit.data.column_layout import Layout
from ifrfit.data.column_roles import identify
from ifrfit.data.conventions import Conventions
from ifrfit.data.selection import Selection
from ifrfit.data.stream.files import NotStreamableError
from ifrfit.data.stream.used_columns import STREAMED, UsedColumns, keys_that_count
from ifrfit.errors import DataError, IfrfitError, UsageError
from ifrfit.physics.observables import OBSERVABLES

ALL = Selection()


def layout_of(*headers: str) -> Layout:
    """Columns without a row."""
    columns = [np.empty(0) for _ in headers]
    cells = Cells("some/a.csv", "", list(headers), 1, np.empty(0, dtype=np.int64), columns)
    return identify(cells, Conventions(), note_open=lambda *_: None)


def used(headers: str, selection: Selection = ALL) -> UsedColumns:
    return UsedColumns.of(layout_of(*headers.split()), selection)


def test_all_columns_of_different_measurements_are_used():
    found = used("gamma_deg e_n sigma_e_n beta sigma_beta spin_y speed_m_s series")
    assert found == UsedColumns(("e_n", "beta"), True, ("e_n", "beta", "sigma:e_n", "sigma:beta", "spin_y"))
    assert found.has_spin


@pytest.mark.parametrize(
    ("headers", "observables", "beside"),
    [
        ("gamma_deg beta", "beta", ""),
        ("gamma_deg e_n mu beta", "e_n beta mu", ""),
        ("gamma_deg beta beta_cm e_n", "beta_cm e_n beta", "beta"),
        ("gamma_deg e_n v_n", "v_n e_n", "e_n"),
        ("gamma_deg v_x v_n spin_y_after", "v_x v_n spin_y_after", ""),
        ("gamma_deg v_x spin_y_after beta beta_cm", "v_x spin_y_after beta_cm beta", "beta_cm beta"),
        # the spin leaves beta nothing of its own; centre alone is measured where it is empty
        ("gamma_deg beta spin_y_after", "spin_y_after beta", "beta"),
        # not streamed, and so not beside
        ("gamma_deg beta mu_app", "beta", ""),
        ("e_n", "e_n", ""),
    ],
)
def test_others_are_used_where_the_first_are_not_measured(headers, observables, beside):
    found = used(headers)
    assert found.observables == tuple(observables.split())
    assert found.beside == tuple(beside.split())
    assert not found.has_sigma
    assert not found.has_spin


def test_a_note_says_what_is_used_and_left_out():
    (note,) = used("gamma_deg beta_cm beta mu_app").notes
    assert note == (
        "a.csv: beta_cm used, beta only where these are not measured and mu_app left out: they are of the "
        "same impacts and would count them twice"
    )
    assert used("gamma_deg beta_cm e_n").notes == ()


def test_those_asked_for_by_name_stand_alone():
    asked = Selection(observable=("e_n", "beta", "beta_cm"))
    found = used("gamma_deg beta_cm sigma_beta_cm beta sigma_beta e_n sigma_e_n v_n mu", asked)
    assert found.observables == ("beta_cm", "e_n")
    assert found.beside == ()
    assert found.keys == ("beta_cm", "e_n", "sigma:beta_cm", "sigma:e_n")
    assert found.notes == (
        "a.csv: beta_cm and e_n used, beta left out: they are of the same impacts and would count them twice",
    )


def test_independent_readings_are_all_used():
    found = used("gamma_deg beta_cm beta e_n", Selection(independent=True))
    assert found.observables == ("beta_cm", "e_n", "beta")
    assert found.beside == ()
    assert found.notes == ()


def test_sigmas_are_used_where_every_observable_has_them():
    found = used("gamma_deg beta_cm beta sigma_beta_cm e_n sigma_e_n")
    assert found.has_sigma
    assert found.observables == ("beta_cm", "e_n")  # beta has none
    assert found.notes[0].startswith("a.csv: beta_cm and e_n used, beta left out")
    few = used("gamma_deg beta sigma_beta e_n")
    assert not few.has_sigma
    assert few.notes == (
        "a.csv: sigma_beta is not used, because not every observable has a column of uncertainties: errors "
        "are taken from the scatter",
    )
    assert used("gamma_deg beta sigma").has_sigma
    assert used("gamma_deg beta sigma").keys == ("beta", "sigma")


@pytest.mark.parametrize(
    ("counts", "empty", "has_spin"),
    [
        ({"spin_x": 0, "spin_y": 3}, ("spin_x",), True),
        ({"spin_x": 0, "spin_y": 0}, ("spin_x", "spin_y"), False),
        ({"spin_x": 1, "spin_y": 1}, (), True),
    ],
)
def test_a_column_of_spins_without_a_value_is_none(counts, empty, has_spin):
    found = used("gamma_deg beta spin_x spin_y").with_spins_met(counts)
    assert found.empty_spins == empty
    assert found.has_spin == has_spin
    assert found.keys == ("beta", "spin_x", "spin_y")  # other files have these columns, too


def test_what_counts_in_another_file():
    other = layout_of("gamma_deg", "beta", "e_n", "sigma_beta", "spin_x")
    assert keys_that_count(other, ["beta"], ALL) == ("e_n", "beta", "sigma:beta", "spin_x")
    asked = Selection(observable=("beta",))
    assert keys_that_count(other, ["beta"], asked) == ("beta", "sigma:beta", "spin_x")


@pytest.mark.parametrize(
    ("headers", "selection", "kind", "says"),
    [
        ("gamma_deg observable value", ALL, NotStreamableError, "a long table is held in memory.*Name"),
        ("gamma_deg mu_app", ALL, NotStreamableError, "mu_app is read into memory; what is streamed is v_x"),
        ("gamma_deg speed_m_s", ALL, UsageError, "no column of an observable. There is none"),
        ("gamma_deg e_n", Selection(observable=("beta",)), UsageError, "no column of beta. There is e_n"),
        ("beta e_n", ALL, DataError, "no incidence angle. Add a column gamma_deg"),
        ("gamma_deg beta e_n sigma", ALL, DataError, "could belong to any of e_n, beta"),
    ],
)
def test_what_cannot_be_read_some_rows_at_a_time_is_refused(headers, selection, kind, says):
    with refused(kind, match=says):
        used(headers, selection)


@st.composite
def tables(draw):
    """Headers of a table in two orders, and a choice."""
    names = draw(st.lists(st.sampled_from([*STREAMED, "mu_app"]), min_size=1, unique=True))
    sigmas = [f"sigma_{name}" for name in names if draw(st.booleans())]
    others = draw(st.lists(st.sampled_from(["spin_x", "spin_y", "speed_m_s"]), unique=True))
    headers = ["gamma_deg", *names, *sigmas, *others]
    asked = draw(st.lists(st.sampled_from(names), unique=True))
    chosen = [asked, draw(st.permutations(asked))]
    independent = draw(st.booleans())
    selections = [Selection(observable=tuple(each), independent=independent) for each in chosen]
    return headers, draw(st.permutations(headers)), *selections


def outcome(headers, selection):
    try:
        return UsedColumns.of(layout_of(*headers), selection)
    except IfrfitError as error:
        return type(error)


@given(tables())
@example((["gamma_deg", "beta_cm", "beta"], ["beta", "gamma_deg", "beta_cm"], ALL, ALL))
def test_the_choice_does_not_depend_on_the_order_of_columns(given_):
    headers, shuffled, selection, other = given_
    assert outcome(headers, selection) == outcome(shuffled, other)


@given(tables())
def test_the_choice_is_what_the_page_of_rules_says(given_):
    """Rules that leave one answer, held against the table alone."""
    headers, _, selection, _ = given_
    found = outcome(headers, selection)
    if not isinstance(found, UsedColumns):
        return
    asked = selection.observable or [name for name in headers if name in OBSERVABLES]
    first = [name for name in found.observables if name not in found.beside]
    order = list(OBSERVABLES)
    assert list(found.observables) == sorted(found.observables, key=order.index)
    assert set(found.observables) <= set(asked)
    with_sigma = {name for name in asked if f"sigma_{name}" in headers}
    assert found.has_sigma == with_sigma.issuperset(first)
    if selection.independent:
        assert set(first) == set(asked)
        return
    takes = {name: OBSERVABLES[name].takes for name in asked}
    for name in asked:
        before = [one for one in first if order.index(one) < order.index(name)]
        assert (name in first) == all(takes[name].isdisjoint(takes[one]) for one in before)
        beside = not selection.observable and name in STREAMED and name not in first
        assert (name in found.beside) == (beside and (not found.has_sigma or name in with_sigma))
