"""What decides the answer although nobody said so stands in the output."""

from __future__ import annotations

import json

import numpy as np
import pytest
from factories import impacts_file

import ifrfit
from ifrfit.inference.appraise import appraise
from ifrfit.report.page import page

SILENT = "gamma_deg,beta\n" + "\n".join(f"{g},{b}" for g, b in zip(range(10, 90, 8), [
    0.6, 0.62, 0.58, 0.3, 0.05, -0.1, -0.2, -0.31, -0.36, -0.4], strict=True)) + "\n"  # fmt: skip
STATED = SILENT.replace("gamma_deg,beta", "gamma_deg,beta,spin_y,sigma_beta").replace("\n", ",0,0.02\n")
STATED = STATED.replace("sigma_beta,0,0.02", "sigma_beta")
FIX = {"e_n": 0.9}
SCATTER = "errors as large as the scatter"


@pytest.fixture
def file(tmp_path):
    def written(text):
        path = tmp_path / "a.csv"
        path.write_text(text, encoding="utf-8")
        return path

    return written


@pytest.mark.parametrize(
    ("text", "choices", "assumed"),
    [
        (SILENT, {}, ("inertia factor 0.4 (solid sphere)", "no spin before impact", SCATTER)),
        (SILENT, {"inertia_factor": 0.4}, ("no spin before impact", SCATTER)),
        (STATED, {}, ("inertia factor 0.4 (solid sphere)",)),
        (STATED, {"inertia_factor": 0.4}, ()),
        (
            STATED,
            {"inertia_factor": 0.4, "noise": "scaled"},
            ("errors as large as the scatter, in the proportions of sigma",),
        ),
    ],
)
def test_a_table_that_is_silent(file, text, choices, assumed):
    fit = ifrfit.fit(file(text), method="lsq", fix=FIX, **choices)
    assert fit.assumed == assumed
    line = f"assumed: {', '.join(assumed)}"
    assert (line in " ".join(fit.summary().split())) == bool(assumed)
    assert ("assumed:" in fit.summary("markdown")) == bool(assumed)


def test_a_dataset_says_what_hit_what():
    assert ifrfit.fit("kharaz-2001", method="lsq").assumed == (f"{SCATTER}, in the proportions of sigma",)


def test_readings_of_e_n_alone_assume_nothing_of_the_ball(file):
    assert ifrfit.fit(file("e_n\n0.91\n0.9\n0.92\n0.89\n"), method="lsq").assumed == (SCATTER,)


def test_it_is_kept_in_the_file_and_stands_on_the_page(file, tmp_path):
    fit = ifrfit.fit(file(SILENT), method="lsq", fix=FIX)
    fit.save(tmp_path / "r.json")
    assert json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))["assumed"] == list(fit.assumed)
    again = ifrfit.load_result(tmp_path / "r.json")
    assert again.to_dict() == fit.to_dict()
    text = page(again, appraise(again, closures=False))
    assert "Assumed: inertia factor 0.4 (solid sphere), no spin before impact, errors as large" in text


def test_of_two_files_the_one_without_spin_is_named(tmp_path):
    (tmp_path / "silent.csv").write_text(SILENT, encoding="utf-8")
    spun = impacts_file(tmp_path / "spun.csv", {"gamma": np.arange(10.0, 80.0, 9.0), "spin_y": 0.1})
    fit = ifrfit.fit([tmp_path / "silent.csv", spun], method="lsq", fix=FIX)
    assert "no spin before impact in silent.csv" in fit.assumed
