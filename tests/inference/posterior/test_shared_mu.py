"""FR with a closure constant in each series under one mu, which ties it to each transition."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from posterior_questions import Question, measured

from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)
ROWS = {
    "a": measured("beta", FAN, seed=10, series="a", closure="fr", c=0.4),
    "b": measured("beta", FAN, seed=11, series="b", closure="fr", c=0.6, mu=0.15),
}


def test_it_is_the_mixture_over_the_values_of_mu() -> None:
    question = Question(ROWS["a"] + ROWS["b"], "fr", fix={"e_n": 0.9}, separate=("beta0",))
    post = integrate(question.problem())
    assert post.converged
    x, w = np.polynomial.legendre.leggauss(40)
    low, high = 0.125, 0.175  # seven sd either side
    mu, weight = 0.5 * (low + high) + 0.5 * (high - low) * x, 0.5 * (high - low) * w / 2.0
    alone = {s: replace(question, rows=rows, separate=()) for s, rows in ROWS.items()}
    each = {
        s: [integrate(replace(q, fix={"e_n": 0.9, "mu": float(m)}).problem()) for m in mu]
        for s, q in alone.items()
    }
    log_z = np.array([a.log_evidence + b.log_evidence for a, b in zip(each["a"], each["b"], strict=True)])
    share = weight * np.exp(log_z - log_z.max())
    assert abs(post.log_evidence - math.log(share.sum()) - log_z.max()) < 2e-4
    share /= share.sum()
    assert abs(post.mean("mu") - float(share @ mu)) < 2e-4 * post.sd("mu")
    for series, found in each.items():
        name = f"beta0[{series}]"
        mean = float(share @ [p.mean("beta0") for p in found])
        assert abs(post.mean(name) - mean) < 2e-4 * post.sd(name)
        at = post.quantile(name, 0.975)
        assert abs(float(share @ [p.cdf("beta0", at) for p in found]) - 0.975) < 2e-4
