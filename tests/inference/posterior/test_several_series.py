"""Series whose constants are all separate are independent."""

from __future__ import annotations

import numpy as np
from posterior_questions import LEVELS, Question, Row, measured

from ifrfit.inference.posterior import integrate

FAN = (8.0, 17.0, 26.0, 35.0, 50.0, 70.0)


def test_all_separate_is_each_alone_and_evidence_adds() -> None:
    rows = {
        s: (*measured("beta", FAN, seed=seed, series=s, mu=mu), Row("e_n", 5.0, e_n, 0.02, series=s))
        for seed, (s, mu, e_n) in enumerate((("a", 0.15, 0.9), ("b", 0.22, 0.7), ("c", 0.08, 0.8)), 1)
    }
    names = ("e_n", "e_t", "mu")
    joint = integrate(Question(sum(rows.values(), ()), separate=names).problem())
    alone = {s: integrate(Question(r).problem()) for s, r in rows.items()}
    assert set(joint.names) == {f"{n}[{s}]" for s in rows for n in (*names, "kappa")}
    assert abs(joint.log_evidence - sum(p.log_evidence for p in alone.values())) < 4e-4
    for s, post in alone.items():
        for n in (*names, "kappa"):
            sd = post.sd(n)
            assert abs(joint.mean(f"{n}[{s}]") - post.mean(n)) < 2e-4 * sd
            assert abs(joint.sd(f"{n}[{s}]") / sd - 1.0) < 2e-4
            off = joint.quantile(f"{n}[{s}]", np.array(LEVELS)) - post.quantile(n, np.array(LEVELS))
            assert np.abs(off).max() < 2e-4 * sd
