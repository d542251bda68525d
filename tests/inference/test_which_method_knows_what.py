"""Each cell of the tables of docs/priors.md and docs/noise.md, as the method of its column does it."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import ifrfit
from ifrfit import AngleErrors, Beta, LogNormal, Model, Noise, TruncatedNormal
from ifrfit.campaign.run import run_campaign

DOCS = Path(__file__).parents[2] / "docs"
GAMMA = np.linspace(5.0, 80.0, 16)


def impacts() -> pd.DataFrame:
    """Readings of beta and e_n, with noise of 0.02 and 0.01."""
    rng = np.random.default_rng(1)
    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.8, mu=0.15, degrees=True).beta
    noisy = beta + 0.02 * rng.normal(size=16)
    e_n = 0.9 + 0.01 * rng.normal(size=16)
    return pd.DataFrame(
        {"gamma_deg": GAMMA, "beta": noisy, "e_n": e_n, "sigma_beta": 0.02, "sigma_e_n": 0.01}
    )


BOTH = impacts()
BARE = BOTH[["gamma_deg", "beta"]]
ALONE = BARE.assign(sigma=0.02)
TURNED = ALONE.assign(sigma_gamma_deg=0.5)
KNOWN = {"fix": {"e_n": 0.9}}
QUESTIONS: Mapping[str, tuple[pd.DataFrame, Mapping[str, Any]]] = {
    "normal, truncated": (BOTH, {"prior": {"mu": TruncatedNormal(0.15, 0.02, 0.1, 0.2), "e_n": (0.9, 0.02)}}),
    "log-normal, beta": (BOTH, {"prior": {"mu": LogNormal(0.15, 0.1), "e_n": Beta(9, 2)}}),
    "Student's t": (ALONE, {**KNOWN, "noise": Noise("known", tails="student-t")}),
    "effective": (TURNED, {**KNOWN, "noise": Noise("known", angles=AngleErrors("effective"))}),
    "set or measured": (TURNED, {**KNOWN, "noise": Noise("known", angles=AngleErrors("set"))}),
    "ties": (BOTH, {"tie": {"e_t": "-1 + 1.3*mu"}}),
    "a common offset": (ALONE, {**KNOWN, "noise": Noise("known", angles=AngleErrors(offset_sd=1.0))}),
    "errors in common": (ALONE.assign(common1=0.01), KNOWN),
    "a sigma for each": (BOTH, {}),
    "some rows without": (BOTH.assign(sigma_beta=BOTH["sigma_beta"].where(BOTH.index != 3)), {}),
    "most rows without": (BOTH.assign(sigma_beta=BOTH["sigma_beta"].where(BOTH.index < 3)), {}),
    "weights": (ALONE.assign(weights=1.0), KNOWN),
}


def table(page: str) -> tuple[list[str], list[list[str]]]:
    """The head and the lines of the table of methods of a page."""
    lines = re.findall(r"^\|(.*)\|$", (DOCS / page).read_text("utf-8"), re.MULTILINE)
    cells = [[cell.strip() for cell in line.split("|")] for line in lines]
    first = next(i for i, line in enumerate(cells) if line[0] == "" and line[1] == "exact")
    return cells[first][1:], cells[first + 2 :]


METHODS, LINES = table("priors.md")
T = {"tails": "student-t"}
OF_NOISE: Mapping[str, tuple[pd.DataFrame, Mapping[str, Any]]] = {
    "Student-t": QUESTIONS["Student's t"],
    "effective variance": QUESTIONS["effective"],
    "set, measured angles": QUESTIONS["set or measured"],
    "propagated": (BARE, {**KNOWN, "noise": Noise("known", sigma_velocity=0.01, sigma_spin=0.01)}),
    "common offset": QUESTIONS["a common offset"],
    "errors in common": QUESTIONS["errors in common"],
    "sigma known for some": (BOTH.drop(columns="sigma_beta"), {}),
    "the same beside one": (BOTH.drop(columns="sigma_beta"), {"noise": Noise("mixed", **T)}),
    "one unknown noise beside": (BARE, {**KNOWN, "noise": Noise("unknown", **T)}),
    "several unknown noises beside": (BOTH, {"noise": Noise("unknown", **T)}),
}
COLUMNS, OF_PAGE = table("noise.md")
DEAR = "normal, truncated", "bootstrap"  # half a minute
CELLS = [
    pytest.param(
        row,
        method,
        said,
        marks=pytest.mark.long if (method == "mcmc" and said != "refused") or (row, method) == DEAR else (),
        id=f"{row}-{method}",
    )
    for row, line in zip(QUESTIONS, LINES, strict=True)
    for method, said in zip(METHODS, line[1:], strict=True)
]


def answered(method: str, data: pd.DataFrame, asked: Mapping[str, Any], folder: Path) -> float | None:
    """The value of mu by the method of a column."""
    if method == "campaign":
        data.assign(run="a").to_csv(folder / "t.csv", index=False)
        own = {name: value for name, value in asked.items() if name != "noise"}
        found, _ = run_campaign(
            [folder],
            ["run"],
            folder / "out",
            lambda _: [],
            model=Model("ifr", **own),
            noise=asked.get("noise"),
        )
        return found.rows[0].get("mu")
    if method == "data not held in memory":
        data.to_csv(folder / "t.csv", index=False)
        return ifrfit.fit(folder, **asked).constants.mu.value
    chosen = ifrfit.Bootstrap(replicates=100) if method == "bootstrap" else method
    return ifrfit.fit(data, method=chosen, **asked).constants.mu.value


@pytest.mark.parametrize(("row", "method", "said"), CELLS)
def test_each_cell_is_what_the_method_does(row: str, method: str, said: str, tmp_path: Path) -> None:
    data, asked = QUESTIONS[row]
    if said == "refused":
        with pytest.raises((ifrfit.UsageError, ifrfit.DataError)) as info:
            answered(method, data, asked, tmp_path)
        assert re.search(r"[.]$", str(info.value))  # a sentence
        return
    assert answered(method, data, asked, tmp_path) == pytest.approx(0.15, abs=0.02)


def test_rows_are_those_of_the_page() -> None:
    for row, line in zip(QUESTIONS, LINES, strict=True):
        assert row in line[0]


def test_a_covariance_is_known_to_those_who_know_errors_in_common() -> None:
    plain, c = ALONE.drop(columns="sigma"), 0.02**2 * (np.eye(16) + 0.3)
    for method, said in zip(METHODS[:5], LINES[list(QUESTIONS).index("errors in common")][1:], strict=False):
        if said == "refused":
            with pytest.raises(ifrfit.UsageError, match="independent errors only"):
                ifrfit.fit(plain, covariance=c, method=method, **KNOWN)
        elif method != "mcmc":
            found = ifrfit.fit(plain, covariance=c, method=method, **KNOWN)
            assert found.constants.mu.value == pytest.approx(0.15, abs=0.02)


def test_a_campaign_refuses_a_covariance(tmp_path: Path) -> None:
    with pytest.raises(ifrfit.UsageError, match="knows no covariance"):
        run_campaign([tmp_path], ["run"], tmp_path / "out", lambda _: [], covariance=np.eye(2))


@pytest.mark.parametrize("row", OF_NOISE)
def test_each_cell_of_the_page_on_noise_is_what_the_method_does(row: str, tmp_path: Path) -> None:
    (line,) = (each for each in OF_PAGE if each[0].startswith(row))
    data, asked = OF_NOISE[row]
    for column, said in zip(COLUMNS, line[1:], strict=True):
        for method in column.replace("least squares", "lsq").split(", "):
            if said.startswith("refused"):
                with pytest.raises((ifrfit.UsageError, ifrfit.DataError)):
                    answered(method, data, asked, tmp_path)
            elif method != "mcmc":  # which takes long: its cells of the other page are run
                assert answered(method, data, asked, tmp_path) == pytest.approx(0.15, abs=0.02)


def test_rows_are_those_of_the_page_on_noise() -> None:
    for row, line in zip(OF_NOISE, OF_PAGE, strict=True):
        assert line[0].startswith(row)
