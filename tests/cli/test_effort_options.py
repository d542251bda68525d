"""`ifrfit fit --accuracy` and `--budget` as a user runs them."""

from __future__ import annotations

FIT = ("fit", "cross-2019", "--fix", "e_n=0.94")


def test_what_makes_no_sense_is_refused_in_a_sentence(cli):
    found = cli(*FIT, "--accuracy", "1e-6", "--method", "mcmc")
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == (
        "ifrfit: --accuracy 1e-6 takes chains 7e+12 independent draws: ask for 2e-3 or more, or leave "
        "--method mcmc out.\n"
    )


def test_strict_insists_on_the_accuracy(cli, monkeypatch):
    now = iter(range(10_000))
    monkeypatch.setattr("ifrfit.inference.accuracy.request.CLOCK", lambda: float(next(now)))
    found = cli(*FIT, "--accuracy", "1e-6", "--budget", "0.5", "--strict")
    assert found.returncode == 4
    assert "the asked accuracy of 1e-6 of an sd was not reached within 500 ms" in found.stderr
