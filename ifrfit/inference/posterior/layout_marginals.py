"""Every marginal of a posterior, each from the part of the integral that holds it."""

from __future__ import annotations

from ifrfit.inference.model.free_parameter import FreeParameter
from ifrfit.inference.model.noise import noise_name
from ifrfit.inference.posterior.integral_layout import IntegralLayout
from ifrfit.inference.posterior.joint_grid import JointDensity
from ifrfit.inference.posterior.marginals import (
    Marginal,
    scaled_marginal,
    shared_kappa_marginal,
    shared_marginal,
)
from ifrfit.inference.posterior.noise_marginal import noise_marginal
from ifrfit.inference.posterior.parameter_marginals import kappa_marginal, series_marginal
from ifrfit.inference.posterior.quotient_marginal import quotient_marginal
from ifrfit.inference.posterior.transition_roles import TransitionKnown


def marginals_of(layout: IntegralLayout, density: JointDensity) -> dict[str, Marginal]:
    """Every marginal, in the order of theta, then kappa, then noises."""
    found: dict[str, Marginal] = {}
    kappas = kappa_marginals(layout, density)
    for kind in ("e_n", "c", "mu"):
        for block in range(len(layout.blocks)):
            parameter = layout.parameters[kind, block]
            if not isinstance(parameter, FreeParameter) or parameter.name in found:
                continue
            e_n = layout.parameters["e_n", block]
            if layout.separable and kind == "mu" and isinstance(e_n, FreeParameter):
                numbers = block, layout.restitution_series[block]
                kappa = kappas[layout.kappa_names[block]]
                made = quotient_marginal(density, kappa, found[e_n.name], numbers, parameter)
            else:
                made = _parameter_marginal(layout, density, kind, block, parameter)
            found[parameter.name] = made
    found |= kappas
    number = layout.integral.number_of("noise")
    if number is not None:
        found["noise"] = shared_marginal(density, number, "noise")
    for number, names in enumerate(layout.noise_groups):
        for group, name in enumerate(names):
            label = noise_name(name)
            found[label] = noise_marginal(density, number, group, label)
    return found


def kappa_marginals(layout: IntegralLayout, density: JointDensity) -> dict[str, Marginal]:
    """Marginals of kappa, one a series where e_n or mu is separate."""
    found: dict[str, Marginal] = {}
    for block, name in enumerate(layout.kappa_names):
        if name and name not in found:
            found[name] = _kappa_marginal(layout, density, block, name)
    return found


def _parameter_marginal(
    layout: IntegralLayout, density: JointDensity, kind: str, block: int, parameter: FreeParameter
) -> Marginal:
    """Of e_n, c or mu, where mu is no quotient."""
    if layout.separable and kind == "e_n":
        return series_marginal(density, layout.restitution_series[block], "e_n", parameter)
    number = layout.integral.number_of(kind)
    if number is not None:
        return shared_marginal(density, number, parameter.name)
    return series_marginal(density, block, kind, parameter)


def _kappa_marginal(layout: IntegralLayout, density: JointDensity, block: int, name: str) -> Marginal:
    e_n, mu = layout.parameters["e_n", block], layout.parameters["mu", block]
    mu_number, e_number = (layout.integral.number_of(kind) for kind in ("mu", "e_n"))
    if mu_number is not None:
        if layout.separable:  # kappa has taken the place of mu
            return shared_marginal(density, mu_number, name)
        if e_number is not None:
            return shared_kappa_marginal(density, e_number, mu_number, name)
        if not isinstance(e_n, FreeParameter):
            return scaled_marginal(shared_marginal(density, mu_number, name), 1.0 + float(e_n), 0.0, name)
    number = block
    transition_is_known = isinstance(layout.integral.series[number].role, TransitionKnown)
    if transition_is_known and isinstance(e_n, FreeParameter) and not isinstance(mu, FreeParameter):
        of_e_n = _parameter_marginal(layout, density, "e_n", block, e_n)
        return scaled_marginal(of_e_n, float(mu), float(mu), name)
    return kappa_marginal(density, number, name)
