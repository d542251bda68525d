"""Percent as a unit of numbers, and the sign of mathematics as a minus."""

from __future__ import annotations

import pytest


@pytest.mark.parametrize("header", ["beta [%]", "beta (percent)", "beta_percent", "beta_pct"])
def test_percent_is_a_unit_of_numbers(read, header):
    assert read(f"gamma_deg,{header}\n10,41.5\n").table["value"].tolist() == pytest.approx([0.415])


def test_percent_by_convention(read):
    table = read("gamma_deg,beta\n10,41.5\n", "unit:beta=%").table
    assert table["value"].tolist() == pytest.approx([0.415])


@pytest.mark.parametrize("header", ["sigma_beta [%]", "sigma_beta", "sigma"])
def test_an_uncertainty_is_in_percent_as_its_value_is(read, header):
    table = read(f"gamma_deg,beta [%],{header}\n10,41.5,2\n").table
    assert table["sigma"].tolist() == pytest.approx([0.02])


@pytest.mark.parametrize("text", ["gamma_deg,beta\n10,\u22120.25\n", "gamma_deg;beta\n10;\u22120,25\n"])
def test_the_minus_of_mathematics_is_a_sign(read, text):
    assert read(text).table["value"].tolist() == [-0.25]


def test_the_minus_of_mathematics_in_an_exponent(read):
    assert read("gamma_deg,beta\n10,25e\u22122\n").table["value"].tolist() == [0.25]


def test_sigmas_that_spread_over_decades_are_none_of_a_slip(read):
    rows = "".join(f"{10 + i},0.4,1e-{i}\n" for i in range(1, 9))
    assert len(read(f"gamma_deg,beta,sigma\n{rows}")) == 8
