from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from factories import assert_golden
from refusals import refused

from ifrfit.data import Source
from ifrfit.errors import UsageError
from ifrfit.inference.diagnostics.headlines import HEADLINES
from ifrfit.inference.diagnostics.thresholds import FACTS
from ifrfit.inference.result.types import QUIET_FACTS, Estimate, Fact, NoiseSummary
from ifrfit.report import summary
from ifrfit.report.provenance import provenance_sentences, reference, stand_in_sentence
from ifrfit.report.sentences import findings, headline

GOLDEN = Path(__file__).parent / "golden"


@pytest.mark.parametrize("path", sorted(GOLDEN.iterdir()), ids=lambda path: path.name)
def test_golden_text(made, path):
    style = {".txt": "text", ".md": "markdown", ".tex": "latex"}[path.suffix]
    assert_golden(f"{summary(getattr(made, path.stem)(), style)}\n", path)


def test_the_text_table_is_plain_ascii_and_narrow_whatever_the_case(made):
    cases = ("fine", "stand_in", "two_observables", "all_sticking", "separate", "contradicted", "posterior")
    for name in cases:
        text = summary(getattr(made, name)())
        assert text.isascii()
        assert max(map(len, text.split("\n"))) <= 100, name
        assert not re.search(r" $", text, flags=re.MULTILINE)


def test_a_result_that_is_not_fine_says_so_in_its_first_line(made):
    lines = summary(made.contradicted()).split("\n")
    assert lines[0] == "LOOK  the data contradict the closure; outliers. Details below."
    series_styles = [line for line in lines if line.startswith("  LOOK")]
    assert len(series_styles) == 2
    # a constant on its bound has said so in the table: a note, no alarm
    assert "  note  e_t lies on its bound -1." in lines


def test_a_failing_stand_in_shows_both_at_once(made):
    result = made.stand_in()
    broken = replace(result, facts=made.contradicted().facts)
    lines = summary(broken).split("\n")
    assert lines[0].startswith("LOOK")
    assert lines[2].startswith("cross-2019   STAND-IN, generated")


def test_scaled_noise_states_the_factor_and_digitised_data_their_kind(made):
    text = summary(made.two_observables())
    assert "  noise       1.8       -                      times the given sigma\n" in text
    assert text.count("noise  ") == 1
    assert "Read off a published figure, whose reading errors are part of the scatter." in text
    assert "40 impacts (80 rows), beta_cm and delta_deg, digitised" in text


def test_scaled_noise_without_points_states_sigma_itself(made):
    result = made.two_observables()
    text = summary(replace(result, points=result.points.iloc[:0]))
    assert "of beta_cm" in text
    assert "times the given" not in text
    assert "80 rows, digitised" in text


def test_noises_that_differ_name_their_series(made):
    noise = NoiseSummary("unknown", {"dry/beta": 0.04, "wet & <oiled>/beta": 0.061})
    text = summary(replace(made.separate(), noise=noise))
    assert "two unknown noises" in text
    assert "of beta in dry\n" in text
    assert "of beta in wet & <oiled>\n" in text


def test_noise_of_the_only_series_does_not_name_it(made):
    result = made.posterior()
    first = dict(list(result.noise.estimates.items())[:1])
    assert "] of beta\n" in summary(replace(result, noise=replace(result.noise, estimates=first))).replace(
        "]   of", "] of"
    )


@pytest.mark.parametrize("estimated", [True, False])
def test_many_noises_of_one_observable_take_one_row(made, estimated):
    sigma = {f"run {i}/beta": 0.04 + 0.003 * i for i in range(7)} | {"drops/e_n": 0.012}
    estimates = {name: made.estimate(value, 0.1 * value) for name, value in sigma.items()}
    noise = NoiseSummary("unknown", sigma, estimates if estimated else {})
    text = summary(replace(made.posterior(), noise=noise))
    assert "eight unknown noises" in text
    rows = [line for line in text.splitlines() if line.startswith("  noise")]
    assert len(rows) == 2
    assert any(" 0.040..0.058 " in row and row.endswith("of beta, in 7 series") for row in rows)
    assert any(" 0.012" in row and row.endswith("of e_n") for row in rows)


def test_the_evidence_stands_beside_chi2(made):
    stand_in = made.stand_in()
    text = summary(replace(stand_in, fit=replace(stand_in.fit, log_evidence=-12.345)))
    assert "  chi2 = 31.2 for 32 degrees of freedom (p = 0.51); log evidence -12.35\n" in text
    assert "- log evidence 41.24." in summary(made.posterior(), "markdown")
    assert r"$0.0481 \pm 0.0062$ & $[0.0359, 0.0603]$ & of beta in dry" in summary(made.posterior(), "latex")


def checks(failed, **p):
    """Failing predictive checks."""
    figures = {"failed": failed, **{f"p_{name}": value for name, value in p.items()}}
    return Fact(False, "the posterior does not predict such data, by some checks: this and that", figures, "")


def test_predictive_checks_that_fail_beside_the_fit_are_told_with_it(made):
    base = made.contradicted()
    failing = checks(["chi2", "runs"], chi2=2e-9, runs=0.0002, largest=0.2, share=0.1)
    result = replace(base, facts={**base.facts, "predictive": failing})
    assert headline(result) == headline(base) == "the data contradict the closure; outliers"
    series_styles = [says for kind, says in findings(result) if kind == "LOOK"]
    assert series_styles[0].endswith(
        "; posterior predictive checks fail too: chi2 (p = 2e-09) and runs of signs (p = 2e-04)"
    )
    assert len(series_styles) == 2
    assert "this and that" not in summary(result)


def test_a_residual_that_is_too_large_is_told_with_the_outliers(made):
    base = made.contradicted()
    failing = checks(["largest"], largest=8e-13)
    facts = {**base.facts, "predictive": failing, "lack_of_fit": made.fine().facts["lack_of_fit"]}
    result = replace(base, facts=facts)
    assert headline(result) == "outliers"
    series_styles = [says for kind, says in findings(result) if kind == "LOOK"]
    assert series_styles == [
        "impacts.csv, line 22 is an outlier; posterior predictive checks fail too: "
        "largest residual (p = 8e-13)"
    ]
    # more than the one row: told by itself
    facts["predictive"] = checks(["largest", "runs"], largest=8e-13, runs=1e-4)
    assert headline(replace(base, facts=facts)) == "outliers; the posterior does not predict such data"


def test_predictive_checks_that_fail_alone_say_so_themselves(made):
    base = made.fine()
    result = replace(base, facts={**base.facts, "predictive": checks(["runs"], runs=1e-5)})
    assert headline(result) == "the posterior does not predict such data"
    assert summary(result).startswith("LOOK  the posterior does not predict such data. Details below.\n")
    assert ("LOOK", result.facts["predictive"].says) in findings(result)


def test_shared_constants_that_are_refuted_are_in_the_headline(made):
    base = made.fine()
    says = "the data favour separate mu over one mu for all series by a factor 31: --separate mu"
    result = replace(base, facts={**base.facts, "sharing": Fact(False, says, {}, "")})
    assert headline(result) == "the series do not share their constants"
    assert ("LOOK", says) in findings(result)


def test_two_transitions_and_single_impacts(made):
    angles = (made.estimate(12.03, 0.51), made.estimate(40.2, 1.3))
    result = made.build((made.Run("run 1", 1),), derived={"transition_angle_deg": {"run 1": angles}})
    text = summary(result)
    assert "0 impacts stick, 1 slides; transitions at 12.03 +- 0.51 and 40.2 +- 1.3 degrees" in text
    assert "1 impact, beta" in text


def test_values_without_an_angle_are_not_counted_as_impacts(made):
    assert "40 values, e_n," in summary(made.build((made.Run("drops", 40),), ("e_n",)))
    assert "impacts stick" not in summary(made.build((made.Run("drops", 40),), ("e_n",)))


@pytest.mark.parametrize(
    ("status", "reason", "words"),
    [
        ("prior", "rests on your prior of e_n", "prior: rests on your prior of e_n"),
        ("fixed", "fixed by you", "fixed by you"),
        ("fixed", "closure F", "fixed: closure F"),
        ("determined", "", "determined"),
    ],
)
def test_status_words(made, status, reason, words):
    one = Estimate(0.98, 0.01, (0.97, 0.99), (0.96, 1.0), status, reason)
    result = made.fine()
    text = summary(replace(result, constants={**result.constants, "e_n": one}))
    assert re.search(rf"e_n .* {re.escape(words)}\n", text)


@pytest.mark.parametrize(
    ("provenance", "sentences"),
    [
        ("simulated", ["Computed by a simulation, not measured."]),
        ("", ["Where these values come from is not stated; --convention provenance=measured would say it."]),
        (
            "measured, simulated",
            ["Values as their authors measured them.", "Computed by a simulation, not measured."],
        ),
        (
            "measured, stand-in",
            [
                "STAND-IN, generated from the constants the paper prints. This fit shows that the tool "
                "works, not what real spheres and walls do.",
                "Values as their authors measured them.",
            ],
        ),
    ],
)
def test_provenance_sentences(made, provenance, sentences):
    result = made.fine()
    source = Source("x", "", 1, 1, {}, provenance)
    assert provenance_sentences(replace(result, points=result.points.iloc[:0]), source) == sentences


def test_only_the_rows_used_count_for_the_provenance(made):
    result = made.fine()
    source = replace(result.inputs[0], provenance="measured, simulated")
    text = summary(replace(result, inputs=(source,)))
    assert "34 impacts, beta, measured, no sigma given" in text
    assert "simulation" not in text


def test_conditions_that_say_where_they_stand_are_understood(made):
    conditions = {"material": {"value": "glass", "where": "Fig. 7"}, "wall": {"value": "steel", "where": ""}}
    source = Source("x", "", 1, 1, {}, "stand-in", "", replace(made.CROSS, conditions=conditions))
    assert stand_in_sentence(source).endswith("not what glass on steel does.")


def test_reference_of_a_dataset_and_of_a_file(made):
    source = Source("x", "", 1, 1, {}, "stand-in", "", made.CROSS)
    assert reference(source) == "Steel ball on granite."
    assert reference(source, full=True) == "Steel ball on granite. Source: a paper's printed constants."
    assert reference(replace(source, descriptor=None)) == ""


def test_what_the_top_says_of_a_stand_in_is_not_said_again(made):
    warning = "cross-2019 is a STAND-IN, generated from the constants the paper prints: ..."
    result = replace(made.stand_in(), warnings=(warning, "another"))
    assert findings(result)[-1] == ("note", "another")
    assert summary(result).count("STAND-IN") == 1


def test_scaled_noise_with_several_factors_names_the_observables(made):
    result = made.two_observables()
    points = result.points
    points.loc[points["observable"] == "delta_deg", "sigma"] *= 0.5
    text = summary(replace(result, points=points))
    assert "1.8       -                      times the given sigma of beta_cm" in text
    assert "3.6       -                      times the given sigma of delta_deg" in text


def test_an_open_kappa_is_not_called_no_transition(made):
    result = made.all_sticking()
    derived = {**result.derived, "transition_angle_deg": {"run 1": None}}
    assert "12 impacts stick, 0 slide; transition not determined\n" in summary(
        replace(result, derived=derived)
    )


def test_selection_is_told(made):
    result = made.fine()
    source = replace(result.inputs[0], selection="gamma from 15 degrees")
    assert "Selection: gamma from 15 degrees. 2 of 36 rows left out" in summary(
        replace(result, inputs=(source,))
    )


def test_a_warning_that_a_fact_already_says_is_not_repeated(made):
    result = made.contradicted()
    says = result.facts["outliers"].says
    told = findings(replace(result, warnings=(says, "another")))
    assert [sentence for _, sentence in told].count(says) == 1
    assert ("note", "another") in told


def test_latex_escapes_what_comes_from_data(made):
    text = summary(made.separate(), "latex")
    assert r"$\mu$ (wet \& $<$oiled$>$)" in text
    assert r"$0.090 \pm 0.012$" in text


def test_unknown_style(made):
    with refused(UsageError) as caught:
        summary(made.fine(), "word")
    assert caught.value.in_shell == "There is no summary style 'word'. Choose one of text, markdown, latex."


def test_every_fact_that_may_fail_has_words_for_the_first_line():
    assert set(FACTS) == {*HEADLINES, *QUIET_FACTS}
