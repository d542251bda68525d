"""Information criteria and posterior probabilities of closures."""

from __future__ import annotations

from collections.abc import Mapping

from scipy import special

from ifrfit.inference.result.fit_result import FitResult


def aicc(result: FitResult) -> float | None:
    """AIC corrected for few rows; None where that form is not defined.

    The correction 2 k (k + 1)/(n - k - 1) is derived for linear models with one unknown noise scale, which k
    counts; with known noise AIC itself is exact there, and with several scales, or one beside known
    noise, there is no such form.

    References
    ----------
    Hurvich & Tsai (1989), Biometrika 76, 297.
    """
    n = result.fit.n
    one_scale = result.noise.policy not in ("known", "mixed") and len(result.noise.estimates) == 1
    k = result.fit.rank + 1
    if not one_scale or n - k - 1 <= 0:
        return None
    return result.fit.aic + 2.0 * k * (k + 1) / (n - k - 1)


def probabilities(log_evidence: Mapping[str, float]) -> dict[str, float]:
    """Posterior probability of each closure, all equally probable before."""
    return dict(zip(log_evidence, special.softmax(list(log_evidence.values())).tolist(), strict=True))
