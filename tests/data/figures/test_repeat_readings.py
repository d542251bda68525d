"""Several readings of one figure are one measurement; what only resembles another is not taken for it."""

from __future__ import annotations

import numpy as np
import pytest
from project_files import as_json, dataset, pixel, version_4
from refusals import refused

import ifrfit
from ifrfit.data import Selection, combine, read, select
from ifrfit.data.read_figure import read_figure
from ifrfit.errors import UsageError

GAMMA = np.linspace(8.0, 82.0, 15)
BETA = ifrfit.rebound(GAMMA, e_n=0.9, e_t=0.5, mu=0.15, degrees=True).beta


def clicked(seed, *, gamma=GAMMA, beta=BETA, wrong=0.7):
    rng = np.random.default_rng(seed)
    exact = np.array([pixel(g, b) for g, b in zip(gamma, beta, strict=True)])
    return [tuple(point) for point in (exact + wrong * rng.standard_normal(exact.shape)).tolist()]


def written(path, *sets):
    coll = [dataset(name=name, points=points) for name, points in sets]
    path.write_bytes(as_json(version_4(dataset_coll=coll)))
    return path


def figure(path):
    return read_figure(path, x="gamma_deg", y="beta")


def test_two_files_of_one_figure_count_once(tmp_path):
    one = figure(written(tmp_path / "one.json", ("glass", clicked(1))))
    two = figure(written(tmp_path / "two.json", ("again", clicked(2))))
    chosen = select(combine([one, two]), Selection())
    assert set(chosen.table.source) == {"one.json"}
    assert any(
        "beta of again in two.json reads the points of beta of glass in one.json again (15 of 15 agree in angle and "
        "value): it is one measurement and counts once" in note
        for note in chosen.notes
    )
    assert [dict(source.rows_skipped) for source in chosen.sources] == [{}, {"read off twice": 15}]
    assert len(select(combine([one, two]), Selection(independent=True)).table) == 30


def test_two_datasets_of_one_file_count_once(tmp_path):
    found = figure(written(tmp_path / "one.json", ("first", clicked(1)), ("second", clicked(2)[::-1])))
    chosen = select(found, Selection())
    assert set(chosen.table.series) == {"first"}


def test_a_reading_of_a_part_is_one_too(tmp_path):
    one = figure(written(tmp_path / "one.json", ("glass", clicked(1))))
    two = figure(written(tmp_path / "two.json", ("glass", clicked(2)[3:10])))
    assert set(select(combine([two, one]), Selection()).table.source) == {"two.json"}


@pytest.mark.parametrize("seed", range(20))
def test_the_control_another_experiment_of_the_same_constants_is_its_own(tmp_path, seed):
    """The same law and the same angles, but other impacts, which scatter by 0.02."""
    rng = np.random.default_rng(seed)
    made = [
        figure(written(tmp_path / f"{i}.json", ("a", clicked(i, beta=BETA + 0.02 * rng.standard_normal(15)))))
        for i in (1, 2)
    ]
    assert len(select(combine(made), Selection()).table) == 30


def test_two_published_readings_of_one_experiment(tmp_path):
    """Kharaz, Gorham & Salman (2001) as two teams read it; one of 8 points the other does not have."""
    kratos = "2.2376,0.79654\n4.2178,0.74629\n9.8416,0.67545\n20.2178,0.59885\n30.3564,0.69028\n39.5446,0.7743\n"
    kratos += "49.604,0.84761\n71.0693,0.93657\n79.2277,0.96952\n85.1683,0.97941\n"
    mfix = "2.0275,0.7938\n3.9282,0.745\n9.6304,0.6728\n20.0845,0.5964\n30.2218,0.6883\n39.3031,0.7719\n"
    mfix += "49.5459,0.8469\n59.8416,0.9019\n"
    made = []
    for name, text in (("kratos", kratos), ("mfix", mfix)):
        (tmp_path / f"{name}.csv").write_text(text)
        given = {"x": "gamma_deg", "y": "e_t", "convention": "e_t=centre"}
        made.append(read_figure(tmp_path / f"{name}.csv", **given))
    chosen = select(combine(made), Selection())
    assert set(chosen.table.source) == {"kratos.csv"}
    assert any("(7 of 8 agree in angle and value)" in note for note in chosen.notes)


def test_measured_tables_are_not_compared(tmp_path):
    (tmp_path / "a.csv").write_text("gamma_deg,beta\n" + "".join(f"{g},{b}\n" for g, b in zip(GAMMA, BETA, strict=True)))
    (tmp_path / "b.csv").write_text("gamma_deg,beta\n" + "".join(f"{g},{b + 1e-4}\n" for g, b in zip(GAMMA, BETA, strict=True)))
    made = combine([read(tmp_path / "a.csv"), read(tmp_path / "b.csv")])
    assert len(select(made, Selection()).table) == 30


def test_a_fit_says_so(tmp_path):
    files = [written(tmp_path / f"{i}.json", ("glass", clicked(i))) for i in (1, 2)]
    said = ["x=gamma_deg", "y=beta"]
    fit = ifrfit.fit(files, convention=said, fix={"e_n": 0.9}, noise="scaled")
    assert any("counts once" in note for note in fit.summary().splitlines()) or "counts once" in str(fit.warnings)
    alone = ifrfit.fit(files[0], convention=said, fix={"e_n": 0.9}, noise="scaled")
    assert fit.constants["mu"].stderr == pytest.approx(alone.constants["mu"].stderr)
    with refused(UsageError, "the same data are given twice"):
        ifrfit.fit([files[0], files[0]], convention=said)
