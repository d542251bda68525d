"""Published constants of pairs: the table as it was printed, a user's own, priors, and what is refused."""

from __future__ import annotations

import math

import pytest
from command_line import in_this_process
from refusals import refused

import ifrfit
from ifrfit.data import materials
from ifrfit.data.materials import COLUMNS, all_pairs, find_pair, prior_values
from ifrfit.errors import DataError, UsageError

HEADER = ",".join(COLUMNS)
OWN = "my glass,my wall,sphere-plate,2.0,0.9,0.02,,,0.2,0.01,measured,my notebook"


@pytest.fixture
def place(tmp_path, monkeypatch):
    """The user's own file of pairs."""
    monkeypatch.setenv("IFRFIT_DATA_DIR", str(tmp_path))
    return tmp_path / "materials.csv"


def test_the_table_is_as_printed(place):
    pairs = all_pairs()
    assert len(pairs) == 11
    assert {each.provenance for each in pairs} == {"published"}
    # from the chart of the Cornell group and p. 78 of Joseph & Hunt, typed here once more
    glass = find_pair("soda-lime glass/soda-lime glass")
    assert glass.values == {"e_n": (0.97, 0.01), "beta0": (0.44, 0.07), "mu": (0.092, 0.006)}
    assert find_pair("Zerodur/steel").values["mu"] == (0.110, 0.003)
    assert find_pair("polyurethane/polyurethane").values["mu"] == (0.80, 0.19)


def test_an_unknown_pair_is_answered_with_what_to_do(place):
    with refused(
        UsageError, r"no published constants of 'soda-lime glas/soda-lime glass'.*Did you mean soda"
    ):
        find_pair("soda-lime glas/soda-lime glass")
    with refused(UsageError, "no published constants of 'glass'"):
        find_pair("glass")


def test_a_printed_error_of_zero_is_no_certainty(place):
    steel = find_pair("chrome steel/chrome steel")
    with refused(UsageError, r"mu was printed as 0\.12 with an error of 0, .* --prior mu=0\.12,SD, or --fix"):
        prior_values(steel)
    assert set(prior_values(steel, ("mu",))) == {"e_n", "beta0"}
    with refused(UsageError, "is no prior"):
        ifrfit.fit("cornell-glass", prior_from="chrome steel/chrome steel")
    fit = ifrfit.fit("cornell-glass", prior_from="chrome steel/chrome steel", prior={"mu": (0.12, 0.05)})
    assert {each.name: each.prior for each in fit.asked}["mu"] == (0.12, 0.05)


def test_a_prior_is_named_in_the_result(place, tmp_path):
    pair = "soda-lime glass/smooth aluminium"
    fit = ifrfit.fit("cornell-glass", closure="fr", prior_from=pair, method="lsq")
    asked = {each.name: each.prior for each in fit.asked}
    assert asked == {"e_n": (0.831, 0.009), "beta0": (0.31, 0.06), "mu": (0.125, 0.007)}
    said = fit.assumed[0]
    assert said.startswith(f"priors published for {pair} (sphere-plate, Cornell chart 1999)")
    assert "mu 0.125 +- 0.007" in said
    assert "would count twice" in said
    assert pair in fit.summary()
    fit.save(tmp_path / "result.json")
    assert ifrfit.load_result(tmp_path / "result.json").assumed == fit.assumed
    fit.report(tmp_path / "report.md")
    assert pair in (tmp_path / "report.md").read_text(encoding="utf-8")


def test_constants_that_the_closure_lacks_are_not_named(place):
    fit = ifrfit.fit("cornell-glass", prior_from="soda-lime glass/smooth aluminium", method="lsq")
    said = next(text for text in fit.assumed if text.startswith("priors published"))
    assert "mu 0.125 +- 0.007" in said
    assert "beta0" not in said


def test_a_prior_is_the_same_as_when_it_is_typed(place):
    found = ifrfit.fit("cornell-glass", prior_from="soda-lime glass/smooth aluminium", method="lsq")
    typed = ifrfit.fit("cornell-glass", prior={"e_n": (0.831, 0.009), "mu": (0.125, 0.007)}, method="lsq")
    assert found.constants == typed.constants
    fixed = ifrfit.fit("cornell-glass", prior_from="glass/Zerodur", fix={"e_n": 0.97}, method="lsq")
    assert fixed.constants.e_n.status == "fixed"


def test_every_closure_takes_what_it_has(place):
    model = ifrfit.Model("ifr", prior_from="glass/Zerodur")
    for closure in ("f", "fr", "ifr", "maw"):
        from ifrfit.physics.closures import get_closure

        found = model.with_closure(get_closure(closure)).parameters(0.4)
        with_prior = {each.name for each in found if each.prior is not None}
        assert with_prior == ({"e_n", "beta0", "mu"} if closure == "fr" else {"e_n", "mu"})


def test_a_users_own_pairs(place):
    place.write_text(f"{HEADER}\n{OWN}\n", encoding="utf-8")
    pair = find_pair("my wall/my glass")
    assert pair.values == {"e_n": (0.9, 0.02), "mu": (0.2, 0.01)}
    assert pair.provenance == "measured"
    # the same pair in another geometry must be chosen, in the same one it is replaced
    other = OWN.replace("sphere-plate", "sphere-sphere").replace("2.0,", ",", 1)
    place.write_text(f"{HEADER}\n{OWN}\n{other}\n", encoding="utf-8")
    with refused(
        UsageError, "published more than once: name one of my glass/my wall/sphere-plate or my glass"
    ):
        find_pair("my glass/my wall")
    assert math.isnan(find_pair("my glass/my wall/sphere-sphere").diameter_mm)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "line 1: the columns of a table of pairs are body,other"),
        ("a,b\n1,2\n", "line 1: the columns"),
        (f"{HEADER}\na,b\n", "line 2: it has 2 cells instead of 12"),
        (f"{HEADER}\n{OWN.replace('0.9,', 'high,')}\n", "line 2, column e_n: 'high' is not a number"),
        (
            f"{HEADER}\n{OWN.replace('0.02', '-1')}\n",
            "line 2, column u_e_n: '-1' is not a number of 0 or more",
        ),
        (f"{HEADER}\n{OWN.replace('0.02', '')}\n", "line 2, column u_e_n: '' is not a number"),
        (f"{HEADER}\n{OWN.replace('0.9,', 'inf,')}\n", "column e_n: 'inf' is not"),
        (f"{HEADER}\n{OWN.replace('my glass', '')}\n", "line 2, column body: '' is empty"),
        (
            f"{HEADER}\n{OWN.replace('my glass', 'a/b')}\n",
            "line 2, column body: 'a/b' is empty or holds a '/'",
        ),
    ],
)
def test_a_broken_file_is_refused_by_line(place, text, words):
    place.write_text(text, encoding="utf-8")
    with refused(DataError, words):
        all_pairs()
    assert in_this_process("materials", "list").returncode == 3


def test_a_file_that_is_no_text_or_too_large_is_refused(place, monkeypatch):
    place.write_bytes(b"\xff\xfe\x00")
    with refused(DataError, "cannot be read as text"):
        all_pairs()
    monkeypatch.setattr(materials, "_LARGEST", 2)
    with refused(DataError, "larger than 2 bytes"):
        all_pairs()


def test_the_commands(place):
    outcome = in_this_process("materials", "list")
    assert (outcome.returncode, len(outcome.stdout.splitlines())) == (0, 11)
    shown = in_this_process("materials", "show", "chrome steel/chrome steel").stdout
    assert "mu     0.12 +- 0  (a printed error of 0 is no prior)" in shown
    assert "source: Cornell chart 1999" in shown
    fitted = in_this_process("fit", "cornell-glass", "--prior-from", "glass/Zerodur", "--method", "lsq")
    assert fitted.returncode == 0
    assert "priors published for glass/Zerodur" in fitted.stdout
    assert in_this_process("materials", "show", "butter/bread").returncode == 2
