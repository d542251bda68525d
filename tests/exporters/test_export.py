"""Exports as a whole: the block of comments, draws, refusals, files, targets of one's own."""

from __future__ import annotations

import csv
import json
from dataclasses import replace

import numpy as np
import pytest
from command_line import in_this_process
from factories import impacts_file, table_file
from refusals import refused

import ifrfit
from ifrfit.errors import UsageError
from ifrfit.exporters.export import write_export
from ifrfit.exporters.protocol import HASH, Response, Translation
from ifrfit.exporters.registry import EXPORTERS
from ifrfit.registry import registered


@pytest.fixture(scope="module")
def fit():
    return ifrfit.fit("cornell-glass")


@pytest.fixture(scope="module")
def open_fit(tmp_path_factory):
    """Impacts that only stick: mu is not determined."""
    path = impacts_file(
        tmp_path_factory.mktemp("stick") / "stick.csv",
        {"gamma": range(2, 12, 2), "sigma": 0.02, "noise": 0.02},
    )
    return ifrfit.fit(path, fix={"e_n": 0.94})


@pytest.fixture(scope="module")
def saved(fit, tmp_path_factory):
    path = tmp_path_factory.mktemp("saved") / "result.json"
    fit.save(path)
    return path


def unwrapped(text):
    return " ".join(line.lstrip("#* ").strip() for line in text.splitlines())


def test_the_block_says_where_it_comes_from(fit):
    said = unwrapped(fit.export("python"))
    mu = fit.constants.mu
    assert "Data: cornell-glass, 48 rows, provenance measured" in said
    assert "Closure IFR, inertia factor J = 0.4, method exact; sigma estimated from the scatter." in said
    assert "Range of the data: 2.66 to 57.83 degrees, 1.151 to 1.295 m/s, without spin before;" in said
    assert "LOOK" not in said
    assert f"mu = {mu.value:.10g}, sd {mu.stderr:.3g}" in said
    assert "; determined." in said
    assert "one_sided (lies on its bound -1)" in said
    assert "Quantiles of the posterior at 2.5, 16, 50, 84, 97.5 %:" in said
    assert "beta within 1e-12" in said


def test_a_stand_in_is_said_first():
    text = ifrfit.fit("cross-2019", fix={"e_n": 0.94}, method="lsq").export("python")
    assert text.index("STAND-IN data") < text.index("Data: cross-2019")
    assert "Quantiles of the distribution of method lsq" in text


def test_what_does_not_stand_is_said():
    """The limestone refutes one set of constants, and its constants leave with that."""
    fit = ifrfit.fit("wang-2018-limestone", method="lsq")
    said = unwrapped(fit.export("python"))
    assert "LOOK: the data contradict one set of constants (p = 8e-10, smooth departure)" in said
    assert "LOOK: e_n of 0.2 m is not one value" in said
    assert said.index("LOOK") < said.index("e_n = 0.4843")


def test_a_proof_that_is_missing_is_no_doubt():
    """No bound is known for closure MAW: a note on the terminal, and nothing in an export."""
    fit = ifrfit.fit("cornell-glass", closure="maw", method="lsq")
    assert not fit.facts["global_optimum"].ok
    assert "not proven" not in unwrapped(fit.export("csv"))


def test_what_was_not_tested_is_said():
    fit = ifrfit.fit("netl-glass-acrylic", method="lsq")
    said = unwrapped(fit.export("json", fix={"e_t": -0.9}))
    assert "LOOK: the fit is not tested: all rows are repeats of single values." in said
    assert "Range of the data: no oblique impact; single values without an angle." in said


def test_range_and_provenance_are_those_of_the_rows_used():
    fit = ifrfit.fit("kharaz-2001", fix={"e_n": 0.98}, method="lsq", gamma_min=20.0)
    said = unwrapped(fit.export("csv"))
    assert "provenance digitised, selection:" in said  # simulated rows of the file are not used
    assert f"Range of the data: {fit.points['gamma_deg'].min():.4g} to" in said
    spins = ifrfit.fit("cross-2019", series=["spin 0.225"], fix={"e_n": 0.94}, method="lsq")
    assert "spins R omega/u from 0 to 0.225" in unwrapped(spins.export("csv"))


def test_rows_read_some_at_a_time_say_so(tmp_path):
    folder = tmp_path / "log"
    folder.mkdir()
    gamma = np.arange(5.0, 85.0, 5.0)
    beta = ifrfit.rebound(gamma, e_n=0.94, e_t=-0.9, mu=0.2, degrees=True).beta
    table_file(folder / "a.csv", {"gamma_deg": gamma, "beta": beta, "sigma_beta": np.full(gamma.size, 0.02)})
    said = unwrapped(ifrfit.fit(folder, fix={"e_n": 0.94}, method="lsq").export("csv"))
    assert "Data: log, 16 rows, provenance" in said
    assert "SHA-256" not in said  # a folder has none
    assert "Range of the data: 5 to 80 degrees" in said


def test_draws_are_those_of_the_fit(fit):
    content = json.loads(fit.export("json", draws=50, seed=3))
    table = fit.draws(50, np.random.default_rng(3))
    for name in ("e_n", "e_t", "mu"):
        np.testing.assert_array_equal(content["draws"][name], table[name])
    lines = [line for line in fit.export("csv", draws=50, seed=3).splitlines() if not line.startswith("#")]
    rows = list(csv.reader(lines))
    assert rows[0] == ["row", "e_n", "e_t", "mu"]
    assert len(rows) == 52
    np.testing.assert_array_equal([float(row[3]) for row in rows[2:]], table["mu"])
    assert "Draws, 50 of them: e_n e_t mu" in fit.export("c", draws=50)


@pytest.mark.parametrize("target", list(EXPORTERS))
def test_a_constant_that_is_not_determined_is_never_invented(open_fit, target):
    assert open_fit.constants.mu.value is None
    with refused(UsageError, r"^mu is not determined by the data .* --fix mu=VALUE\.$"):
        open_fit.export(target)


def test_the_user_may_name_it(open_fit):
    said = unwrapped(open_fit.export("csv", fix={"mu": 0.2}))
    assert "mu = 0.2: named by the user for this export, not by the data (" in said
    assert "Quantiles" not in said or " mu 0.0" not in said


@pytest.mark.parametrize(
    ("choices", "words"),
    [
        ({"target": "lamps"}, "There is no export target 'lamps'"),
        ({"draws": -1}, "--draws -1: it must lie between 0"),
        ({"angle": 30.0}, "--angle 30 means nothing to target python"),
        ({"speed": 3.0}, "--speed 3 means nothing to target python"),
        ({"fix": {"mu": 0.2}}, r"--fix mu=0.2: the fit has mu = .* \(determined\)"),
        ({"fix": {"en": 0.2}}, "--fix en: closure IFR has no such constant. It has e_n, e_t and mu. Did you"),
    ],
)
def test_refusals(fit, choices, words):
    with refused(UsageError, words):
        fit.export(**{"target": "python"} | choices)


@pytest.mark.parametrize("value", [True, "x", float("nan"), -0.1])
def test_a_named_value_is_a_number_in_its_domain(open_fit, value):
    with refused(UsageError, "^--fix mu"):
        open_fit.export("csv", fix={"mu": value})


def test_a_named_value_does_not_contradict_the_data(open_fit, tmp_path):
    """Impacts that stick say that mu is no less than something."""
    low = open_fit.constants.mu.interval95[0]
    with refused(UsageError, rf"^--fix mu=0\.01: the data leave mu from {low:.3g} to inf \(95 %\)\. Name a"):
        open_fit.export("csv", fix={"mu": 0.01})
    fixed = ifrfit.fit("cross-2019", fix={"e_n": 0.94}, method="lsq")
    with refused(
        UsageError, r"^--fix e_n=0\.5: the fit has e_n = 0\.94 \(fixed\)\. An export does not replace"
    ):
        fixed.export("csv", fix={"e_n": 0.5})
    # sliding alone: the data know mu (1 + e_n), and neither of the two
    path = tmp_path / "slide.csv"
    path.write_text("gamma_deg,beta_cm,sigma_beta_cm\n60,-0.88,0.005\n70,-0.925,0.005\n80,-0.963,0.005\n")
    sliding = ifrfit.fit(path, closure="f")
    low, high = sliding.derived["kappa"].interval95
    with refused(
        UsageError, rf"kappa = mu \(1 \+ e_n\) from {low:.3g} to {high:.3g} \(95 %\), and .* 0\.228: with"
    ):
        sliding.export("csv", fix={"e_n": 0.9, "mu": 0.12})
    assert json.loads(sliding.export("json", fix={"e_n": 0.9, "mu": 0.105}))["constants"]["mu"] == 0.105


def test_separate_constants_need_their_series():
    fit = ifrfit.fit(
        "cross-2019", series=["no spin", "spin 0.225"], separate=["mu"], fix={"e_n": 0.94}, method="lsq"
    )
    with refused(
        UsageError, r"^mu is separate by series: name one with --series, of no spin and spin 0\.225"
    ):
        fit.export("json")
    with refused(UsageError, r"^There is no series 'x'\. mu is separate"):
        fit.export("json", series="x")
    content = json.loads(fit.export("json", series="no spin", draws=3))
    assert content["constants"]["mu"] == fit.constants["mu"]["no spin"].value
    assert len(set(content["draws"]["mu"])) == 3


def test_a_series_that_is_not_there_is_refused_where_all_share_the_constants(fit):
    with refused(UsageError, r"^--series x: the fit has no such series, and one set of .* for all: glass\."):
        fit.export("csv", series="x")
    assert fit.export("csv", series="glass") == fit.export("csv")


def test_the_command_writes_what_python_does(fit, saved, tmp_path):
    again = ifrfit.load_result(saved)
    for target in ("python", "c", "json", "csv"):
        outcome = in_this_process("export", saved, "--to", target, "--draws", 4)
        assert (outcome.returncode, outcome.stderr) == (0, "")
        assert outcome.stdout == again.export(target, draws=4)
    out = tmp_path / "wall.py"
    assert in_this_process("export", saved, "--to", "python", "--out", out).stdout == f"written: {out}\n"
    assert out.read_text() == again.export("python")


def test_files_that_are_there(tmp_path):
    mine, theirs = tmp_path / "mine.py", tmp_path / "theirs.py"
    write_export("# Exported by ifrfit 1\n", mine)
    with refused(UsageError, "an export lies there already. Add --force"):
        write_export("# Exported by ifrfit 2\n", mine)
    write_export("# Exported by ifrfit 2\n", mine, force=True)
    assert mine.read_text() == "# Exported by ifrfit 2\n"
    theirs.write_text("precious")
    with refused(UsageError, "is no export of ifrfit and is not replaced"):
        write_export("# Exported by ifrfit 2\n", theirs, force=True)
    assert theirs.read_text() == "precious"
    with refused(UsageError, "name a file in a folder that is there"):
        write_export("x", tmp_path / "no" / "where.py")


def test_a_usage_error_leaves_nothing(saved, tmp_path):
    out = tmp_path / "x"
    outcome = in_this_process("export", saved, "--to", "nothing", "--out", out)
    assert outcome.returncode == 2
    assert "There is no export target 'nothing'" in outcome.stderr
    assert not out.exists()


class Halves:
    """A target of one's own: half of all restitution."""

    name = "halves"
    title = "Halves"
    comments = HASH
    takes = frozenset()

    def translate(self, constants, at):
        def response(incidence):
            state = constants.rebound(incidence)
            return Response(0.5 * state.v_n, state.v_x)

        return Translation([f"e {0.5 * constants.e_n}"], "half.", ["e = e_n/2."], "never.", response)


def test_a_target_of_ones_own_and_its_residual(fit, saved):
    with registered(Halves()):
        said = unwrapped(fit.export("halves"))
        worst = -0.5 * fit.constants.e_n.value
        assert f"e_n off by {worst:+.3g} at worst" in said
        assert "v_x/u within 1e-12; the spin is left as it was" in said
        assert in_this_process("export", saved, "--to", "halves").returncode == 0
    with refused(UsageError, "There is no export target 'halves'"):
        fit.export("halves")


@pytest.mark.parametrize("target", list(EXPORTERS))
def test_text_of_the_fit_cannot_end_the_comment(fit, target):
    """A command or a name of a file is a comment, whatever it holds."""
    nasty = replace(fit, command="ifrfit fit '*/ system(1); -->\nrun 0\n--\x0bx\u2028y.csv'")
    choices = {name: {"angle": 30.0, "speed": 2.0}[name] for name in EXPORTERS[target].takes}
    if target in ("mujoco", "pybullet"):  # they are run
        pytest.importorskip(target)
    plain, found = fit.export(target, **choices), nasty.export(target, **choices)
    if target == "json":
        assert json.loads(found)["constants"] == json.loads(plain)["constants"]
        return
    signs = EXPORTERS[target].comments
    if signs.closing:
        assert found.count(signs.closing.strip()) == plain.count(signs.closing.strip())
        said = {"*/": "* / system(1); --> run 0 -- x y.csv", "-->": "*/ system(1); - -> run 0 - - x y.csv"}
        assert said[signs.closing.strip()] in unwrapped(found)
        return
    # but for its own lines of comments it is the same text
    left, right = ([line for line in text.splitlines() if not line.startswith(signs.line.strip())]
                   for text in (found, plain))  # fmt: skip
    assert left == right
