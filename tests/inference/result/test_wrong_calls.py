"""What is asked of a result in a wrong way is answered by a sentence with the remedy."""

from __future__ import annotations

import json

import numpy as np
import pandas as pd
import pytest
from matplotlib.figure import Figure

import ifrfit
from ifrfit.report.panels import is_outlier

GAMMA = np.linspace(5.0, 80.0, 20)


def table(mu):
    """Impacts with noise of 0.02."""
    beta = ifrfit.rebound(GAMMA, e_n=0.9, e_t=-0.7, mu=mu, degrees=True).beta
    return {"gamma_deg": GAMMA, "beta": beta + np.random.default_rng(1).normal(0.0, 0.02, GAMMA.size)}


TWO = {"a": table(0.15), "b": table(0.25)}


@pytest.fixture(scope="module")
def fit():
    return ifrfit.fit("cornell-glass")


@pytest.fixture(scope="module", params=["exact", "lsq"])
def separate(request):
    return ifrfit.fit(TWO, separate="mu", fix={"e_n": 0.9}, method=request.param)


def test_a_fact_that_is_not_there(fit):
    with pytest.raises(
        ifrfit.UsageError, match=r"^There is no 'convergd'\. There are converged, .*mean conv"
    ):
        fit.facts["convergd"]
    assert fit.facts.get("convergd") is None
    assert "convergd" not in fit.facts


def test_a_quantity_that_is_not_there(fit, separate):
    for method in (
        fit.distribution.mean,
        fit.distribution.sd,
        lambda name: fit.distribution.covariance([name]),
    ):
        with pytest.raises(ifrfit.UsageError, match=r"quantity 'muu'\. There are e_n, .*Did you mean mu\?"):
            method("muu")
    with pytest.raises(KeyError, match="mu is the same in all series"):
        fit.distribution.quantile("mu[a]", 0.5)
    with pytest.raises(ifrfit.UsageError, match=r"no quantity 'mu'\. .* Name one of mu\[a\] or mu\[b\]\."):
        separate.distribution.quantile("mu", 0.5)
    with pytest.raises(ifrfit.UsageError, match="Name one of"):
        separate.distribution.cdf("mu", 0.1)


def test_a_separate_constant_is_no_estimate(separate):
    mu = separate.constants.mu
    assert f"{mu:.2uS}" == f"a: {mu['a']:.2uS}, b: {mu['b']:.2uS}"
    with pytest.raises(AttributeError, match=r'of a and b\. Take constants\.mu\["a"\]\.value'):
        _ = mu.value
    with pytest.raises(ifrfit.UsageError, match=r"no series 'c' with a mu\. There are a and b"):
        mu["c"]
    with pytest.raises(ifrfit.UsageError, match=r'Take constants\.mu\["a"\]'):
        separate.constants["mu[a]"]


def test_draws_take_a_number_and_a_generator(fit):
    with pytest.raises(ifrfit.UsageError, match=r"rng: 1 draws nothing\. .*default_rng\(1\)"):
        fit.draws(5, 1)
    with pytest.raises(ifrfit.UsageError, match="'5' draws: it must be a whole number"):
        fit.draws("5", np.random.default_rng(1))
    assert len(fit.draws(np.int64(5), np.random.default_rng(1))) == 5


@pytest.mark.parametrize("method", ["exact", "lsq"])
def test_no_draws_are_a_table_without_rows(method):
    fit = ifrfit.fit("cornell-glass", method=method)
    none, one = (fit.draws(n, np.random.default_rng(1)) for n in (0, 1))
    assert none.empty
    assert list(none) == list(one)


def test_axes_are_those_of_matplotlib(fit):
    for drawn in (fit.plot, fit.plot_residuals):
        with pytest.raises(ifrfit.UsageError, match="ax: 'x' is no Axes"):
            drawn(ax="x")
    with pytest.raises(ifrfit.UsageError, match="no Axes of matplotlib with two dimensions"):
        fit.plot(ax=Figure().add_subplot(projection="3d"))
    with pytest.raises(ifrfit.UsageError, match="ax: 1 is no Axes"):
        fit.plot_corner(axes=np.ones((3, 3), dtype=int))


def test_a_file_goes_into_a_folder(fit, tmp_path):
    with pytest.raises(
        ifrfit.UsageError, match=r"a folder lies there\. Name a file in it, as .*result\.json"
    ):
        fit.save(tmp_path)
    fit.save(tmp_path / "not-there" / "result.json")  # as a report does, it makes the folder
    assert ifrfit.load_result(tmp_path / "not-there" / "result.json").constants.mu == fit.constants.mu
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(ifrfit.UsageError, match=r"result\.json: cannot be written \(.*\)\. Choose another"):
        fit.save(tmp_path / "file" / "result.json")


def frame():
    """The impacts as a data frame."""
    return pd.DataFrame(table(0.15))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda: ifrfit.fit(frame(), "fr"), r"'fr' is no Model but a closure: say closure=\"fr\"\.$"),
        (lambda: ifrfit.fit(frame(), "mcmc"), r"'mcmc' is no Model but a method: say method=\"mcmc\"\."),
        (lambda: ifrfit.fit(frame(), "other.csv"), "no Model.*several files or datasets in one list"),
        (lambda: ifrfit.fit(GAMMA, GAMMA), "is a Model, not ndarray: give columns by keyword, gamma_deg="),
        (lambda: ifrfit.fit(frame()["beta"]), r"A Series \('beta'\) is one column"),
        (lambda: ifrfit.fit(frame(), weights=GAMMA), r"Give sigma itself, with noise=\"scaled\""),
        (lambda: ifrfit.compare(frame(), weights=GAMMA), "Give sigma itself"),
        (lambda: ifrfit.fit(frame(), noise="known"), "table, row 0: no sigma"),
        (lambda: ifrfit.fit(frame(), exclude=[99]), "number of a row of the table, TABLE:ROW"),
        (
            lambda: ifrfit.fit(
                frame().assign(gamma_deg=95.0).set_index(pd.Index([f"s{i}" for i in range(20)]))
            ),
            r"table, row 0 \(counted from 0, index 's0'\), column gamma_deg",
        ),
        (lambda: ifrfit.fit(frame(), exclude=object()), "^exclude: <object .* is neither the name or number"),
        (lambda: ifrfit.fit(frame(), exclude=["a"]), r'^exclude="a": names no row'),
        (lambda: ifrfit.fit(frame(), scene=5), r"^scene: 5 is not a path\."),
        (lambda: ifrfit.fit(frame(), fix={5: 1}), r'^fix=\{"5": \.\.\.\}: closure IFR has no such constant'),
        (lambda: ifrfit.fit(frame(), tie={"e_t": 5}), r'^tie=\{"e_t": \.\.\.\}: 5 is not an expression'),
        (lambda: ifrfit.fit(b"gamma_deg,beta"), r"^b'gamma_deg,beta' \(bytes\) is no table"),
        (lambda: ifrfit.fit(""), "^An empty name stands for no data"),
        (lambda: ifrfit.fit([""]), r"^An empty name stands for no data\. Name a file or a dataset"),
        (lambda: ifrfit.compare(frame(), 5), r"^closures: 5 is not a name or several names\."),
        (lambda: ifrfit.compare(frame(), [None]), r"^closures: \(None,\) is not a name"),
        (lambda: ifrfit.compare(frame(), loo="x"), r"^loo: 'x' is not True or False\."),
        (lambda: ifrfit.compare(frame(), workers="a"), r"^workers: 'a' is not a whole number\."),
        (lambda: ifrfit.load_dataset(None), r"^There is no dataset 'None'\. The datasets are"),
        (lambda: ifrfit.load_result(None), r"^path: None is not a path\."),
        (lambda: ifrfit.Bootstrap(replicates=0), "^Bootstrap.replicates=0.: choose from 100 to"),
        (
            lambda: ifrfit.fit(frame().assign(beta=1e-300)),
            r"1e-300 is impossible for beta \(0, or 1e-60 and more in size\)\. Write 0",
        ),
        (lambda: ifrfit.fit(frame().assign(t=1.0)), r'column t: unknown name\. .*"column:NAME=t"'),
        (
            lambda: ifrfit.fit(frame().rename(columns={"beta": "beta, contact"})),
            r'unknown name\. .*"column:NAME=beta, contact"',
        ),
        (
            lambda: ifrfit.fit(pd.concat([frame(), frame()["beta"]], axis=1)),
            "^table: columns 2 and 3 are both",
        ),
    ],
)
def test_what_is_called_in_a_wrong_way_is_told_in_words_of_python(call, says):
    with pytest.raises((ifrfit.UsageError, ifrfit.DataError), match=says):
        call()


def test_what_is_no_probability_has_no_quantile(fit):
    with pytest.raises(ifrfit.UsageError, match=r"1\.5 is no probability. Give p from 0 to 1"):
        fit.distribution.quantile("mu", [0.5, 1.5])


def test_rows_of_a_table_in_memory_are_rows_and_of_a_file_are_lines(tmp_path):
    wrong = frame()
    wrong.loc[7, "beta"] += 1.0
    for data, name in ((wrong, "table row 7 (beta)"), (tmp_path / "t.csv", "t.csv line 9 (beta)")):
        wrong.to_csv(tmp_path / "t.csv", index=False)
        fit = ifrfit.fit(data, fix={"e_n": 0.9})
        fit.save(tmp_path / "result.json")
        for each in (fit, ifrfit.load_result(tmp_path / "result.json")):
            assert each.facts["outliers"].figures["rows"] == [name]
            assert name in each.facts["outliers"].says
            each.report(tmp_path / "report.md")
            assert f"in {name.removesuffix(' (beta)')}." in (tmp_path / "report.md").read_text()
            assert np.flatnonzero(is_outlier(each, each.points)).tolist() == [7]


def test_an_option_that_is_an_object_is_told_as_one():
    with pytest.raises(
        ifrfit.UsageError, match=r"'effective' is no AngleErrors\. Give ifrfit\.AngleErrors\("
    ):
        ifrfit.Noise("known", angles="effective")


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"gamma": [[1.0, 2.0], [3.0, 4.0]]}, r"^gamma: has 2 dimensions\. Give one value for each impact\."),
        ({"gamma": np.nan}, "^gamma nan: there is no such impact"),
        ({"gamma": None}, "^gamma: None is no number, nor an array of them: give numbers"),
        ({"gamma": 10.0, "spin_y": np.inf}, "^spin_y inf: there is no such impact"),
        ({"gamma": 10.0, "observable": ["beta", "e_n"]}, "^There is no observable .*Choose one of"),
        ({"gamma": 10.0, "sigma": "a"}, "^sigma: 'a' is no number"),
        (
            {"gamma": [10.0, 20.0], "sigma": [1.0, 2.0, 3.0]},
            r"^sigma: has shape \(3,\)\. Give one number, or",
        ),
        ({"gamma": 30.0, "degrees": False}, "^gamma 30: .* between 0 and pi/2"),
    ],
)
def test_what_is_no_impact_is_not_predicted(fit, asked, says):
    with pytest.raises(ifrfit.UsageError, match=says):
        fit.predict(**asked)


def test_none_is_no_path(fit):
    for write in (fit.save, fit.report):
        with pytest.raises(ifrfit.UsageError, match=r"^path: None is not a path\."):
            write(None)


def test_a_file_that_is_no_result_is_not_told_to_be_broken(tmp_path, fit):
    table = tmp_path / "impacts.csv"
    frame().to_csv(table, index=False)
    with pytest.raises(ifrfit.DataError, match=r"is not JSON .*\. Name the result\.json of a fit\.$"):
        ifrfit.load_result(table)
    result = tmp_path / "result.json"
    fit.save(result)
    with pytest.raises(ifrfit.DataError, match=r"^.*result\.json: this is JSON, not a text table\."):
        ifrfit.fit(result)
    result.write_text(json.dumps(fit.to_dict() | {"points": 5}), encoding="utf-8")
    with pytest.raises(ifrfit.DataError, match="the key 'points' must be an object"):
        ifrfit.load_result(result)


def test_what_is_no_number_is_not_simulated(tmp_path):
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'sphere = {diameter_mm = 5, material = "alumina"}\nwall = {material = "soda-lime-glass"}\n'
        "impact = {gamma_deg = [20, 60], speed_m_s = 3.9}\nconstants = {e_n = 0.98, e_t = -0.9, mu = 0.09}\n",
        encoding="utf-8",
    )
    for asked in ({"samples": "a"}, {"samples": 1.5}, {"seed": None}):
        with pytest.raises(ifrfit.UsageError, match=r"^(samples|seed): .* is not a whole number\."):
            ifrfit.simulate(scene, **asked)
