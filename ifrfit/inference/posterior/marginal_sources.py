"""Which part of the integral holds which quantity."""

from __future__ import annotations

from collections.abc import Mapping

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.posterior import marginals as of
from ifrfit.inference.posterior.integral_layout import IntegralLayout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginals import Marginal
from ifrfit.inference.posterior.noise_marginal import noise
from ifrfit.inference.posterior.parameter_marginals import series_marginal
from ifrfit.inference.posterior.quotient_marginal import quotient_marginal


def marginals_of(plan: IntegralLayout, grid: JointDensity) -> dict[str, Marginal]:
    """Every marginal, in the order of theta, then kappa, then noises."""
    found: dict[str, Marginal] = {}
    shared = {one.kind: number for number, one in enumerate(plan.joint.shared)}
    kappas = {}
    labels = [_kappa_label(plan, block) for block in range(len(plan.blocks))]
    for block, label in enumerate(labels):
        if label and label not in kappas:
            kappas[label] = _kappa(plan, grid, block, label, shared)
    for kind in ("e_n", "c", "mu"):
        for block in range(len(plan.blocks)):
            unknown = plan.unknowns[kind, block]
            if not isinstance(unknown, FreeParameter) or unknown.name in found:
                continue
            if plan.apart and kind == "mu":
                parts = plan.tangential[block], plan.normal[block]
                e_n = plan.unknowns["e_n", block]
                assert isinstance(e_n, FreeParameter)
                of_e = found[e_n.name]
                found[unknown.name] = quotient_marginal(
                    grid, kappas[labels[block]], of_e, parts, unknown, unknown.name
                )
            else:
                found[unknown.name] = _entry(plan, grid, kind, block, unknown, shared)
    found |= kappas
    if "noise" in shared:
        found["noise"] = of.shared(grid, shared["noise"], "noise")
    for number, names in enumerate(plan.groups):
        for group, name in enumerate(names):
            label = noise_name(name)
            found[label] = noise(grid, number, group, label)
    return found


def _kappa_label(plan: IntegralLayout, block: int) -> str:
    """Name of kappa in a block; empty where it is known."""
    e_n, mu = plan.unknowns["e_n", block], plan.unknowns["mu", block]
    unknown = [u for u in (mu, e_n) if isinstance(u, FreeParameter)]
    if not unknown:
        return ""
    several = len(plan.blocks) > 1
    bracket = next((u.name[u.name.index("[") :] for u in unknown if "[" in u.name), "")
    return f"kappa{bracket if several else ''}"


def _entry(
    plan: IntegralLayout,
    grid: JointDensity,
    kind: str,
    block: int,
    unknown: FreeParameter,
    shared: Mapping[str, int],
) -> Marginal:
    part = plan.tangential[block]
    if plan.apart and kind == "e_n":
        return series_marginal(grid, plan.normal[block], "e_n", unknown.name)
    if kind in shared:
        return of.shared(grid, shared[kind], unknown.name)
    return series_marginal(grid, part, kind, unknown.name)


def _kappa(
    plan: IntegralLayout, grid: JointDensity, block: int, name: str, shared: Mapping[str, int]
) -> Marginal:
    part = plan.tangential[block]
    e_n, mu = plan.unknowns["e_n", block], plan.unknowns["mu", block]
    if "mu" in shared and plan.apart:
        return of.shared(grid, shared["mu"], name)
    if "mu" in shared and "e_n" in shared:
        return of.product_of_shared(grid, shared["e_n"], shared["mu"], name)
    if not isinstance(e_n, FreeParameter) and "mu" in shared:
        return of.scaled(of.shared(grid, shared["mu"], name), 1.0 + float(e_n), 0.0, name)
    series = plan.joint.series[part]
    if series.role == "none" and not isinstance(mu, FreeParameter):
        own = _entry(plan, grid, "e_n", block, e_n, shared)  # type: ignore[arg-type]
        return of.scaled(own, float(mu), float(mu), name)
    return series_marginal(grid, part, "kappa", name)
