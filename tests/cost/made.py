"""Costs that nobody had to measure, and a posterior that nobody has to compute."""

from __future__ import annotations

import math

import numpy as np
from scipy import stats

import ifrfit
from ifrfit.cost.inference_costs import UNIT, Numbers, Reference
from ifrfit.cost.measure import beginning, setting_of
from ifrfit.cost.result import Costs
from ifrfit.cost.timing import Cost, Timing
from ifrfit.inference.fit import make_question
from ifrfit.inference.keywords import model_of
from ifrfit.inference.option_fields import build
from ifrfit.inference.options import Noise

INFERENCE = [  # method, setting, seconds, errors of mean, sd and interval
    ("lsq", "", 0.004, (1.2, 0.8, 1.0)),
    ("profile", "", 0.4, (1.2, 0.3, 0.9)),
    ("exact", "tolerance 1e-1", 0.0124, (4e-5, 1.7e-4, 1.6e-4)),
    ("exact", "tolerance 1e-4", 0.05, (1e-9, 1e-9, 2e-7)),
    ("exact", "tolerance 1e-8", 0.3, (1e-10, 1e-10, 1e-10)),
    ("bootstrap", "100 replicates", 0.02, (1.1, 1.0, 3.9)),
    ("bootstrap", "1,000 replicates", 0.09, (1.2, 1.0, 3.7)),
    ("mcmc", "100 steps", 0.5, (3e-2, 3e-2, 8e-2)),
    ("mcmc", "1,000 steps", 6.2, (6e-3, 7e-3, 1.8e-2)),
]
PHYSICS = [
    ("closure IFR", "e_t = -0.9, given; compiled", 5e-10, 0.6),
    ("table", "compiled", 4e-9, 1.1e-5),
    ("table", "numpy", 4e-8, 1.1e-5),
    ("annuli", "20 annuli", 1.2e-3, 0.08),
    ("memory function", "1000 steps", 1.6e-5, 5.8e-6),
]


def made(data="kharaz-2001", **choices):
    """Costs of inference and physics with a real fit behind them."""
    choices = choices or {"prior": {"e_n": (0.98, 0.01)}}
    costs = []
    for method, setting, seconds, errors in INFERENCE:
        time = Timing(seconds, 0.9 * seconds, 1.4 * seconds, 5)
        costs += [
            Cost("inference", method, setting, quantity, time, error, UNIT)
            for quantity, error in zip(("mean", "sd", "interval95"), errors, strict=True)
        ]
    for method, setting, seconds, error in PHYSICS:
        time = Timing(seconds, 0.9 * seconds, 1.4 * seconds, 5)
        costs.append(Cost("physics", method, setting, "beta", time, error, "1"))
    about = {"physics": "at e_n = 0.98, mu = 0.0934; 2.2 to 85 degrees"}
    fit = ifrfit.fit(data, method="lsq", **choices)
    return Costs(tuple(costs), fit, Reference(1e-9, 1e-10), about, ("A note.",))


def closed_form(problem):
    """Mean, sd and ends of the posterior of e_t: beta in sticking is e_t + 7/5."""
    value, sigma = problem.rows.value - 1.4, problem.noise.sigma
    sd = 1.0 / math.sqrt((sigma**-2).sum())
    mean = float((value / sigma**2).sum()) * sd**2
    law = stats.truncnorm((-1.0 - mean) / sd, (-0.4 - mean) / sd, loc=mean, scale=sd)
    return Numbers(np.array([law.mean()]), np.array([law.std()]), law.ppf([[0.025, 0.975]])), mean, sd


def start_of(path, *, posterior=True, **keywords):
    """The optimum that the costs of inference start from; keywords are those of `ifrfit.fit`."""
    model, question = _asked(path, keywords)
    return beginning(question, model, posterior=posterior)


def setting_at(path, **keywords):
    """Where contact laws and precisions are measured."""
    model, question = _asked(path, keywords)
    return setting_of(beginning(question, model, posterior=False), question, model)


def _asked(path, keywords):
    model = model_of(None, keywords)
    return model, make_question(path, model, build(Noise, keywords), 0, None, keywords)
