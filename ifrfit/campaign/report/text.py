"""A campaign in words, for the terminal."""

from __future__ import annotations

from collections import Counter

from ifrfit.campaign.group_fit import FAILURE, LOOK, PROVENANCE, constants_of
from ifrfit.campaign.population.leave_one_out import FEWEST_OF_SEVERAL
from ifrfit.campaign.population.normal_hierarchy import FEWEST
from ifrfit.campaign.population.partial_pooling import Population
from ifrfit.campaign.run import Campaign, label
from ifrfit.report.provenance import STAND_IN
from ifrfit.text import decimals, fixed, joined, p_text

_SHOWN = 5


def summary(campaign: Campaign) -> str:
    """Counts, the population of each constant, and what calls for a look."""
    lines = [counts(campaign), *warnings(campaign)]
    if campaign.populations:
        lines += ["", f"{'constant':10} {'median group':>22}   {'95 % of new groups':>20}   groups pooled"]
        for each in campaign.populations:
            middle = between(float(each.centre.lo95), float(each.centre.hi95), float(each.centre.median))
            new = between(float(each.new.lo95), float(each.new.hi95))
            limits = f", {each.limits} as limits" if each.limits else ""
            pooled = f"{each.groups.size} of {campaign.fitted}{limits}"
            lines.append(f"{each.name:10} {middle:>22}   {new:>20}   {pooled}")
        lines += [f"  {each}" for each in remarks(campaign)]
    elif campaign.no_population:
        lines += ["", campaign.no_population]
    else:
        lines += [
            "",
            f"No constant is determined by {FEWEST} groups or more: there is no population to tell of.",
            *mostly_open(campaign),
        ]
    if looks := Counter(row[LOOK] for row in campaign.rows if row.get(LOOK)):
        lines += ["", f"to look at: {sum(looks.values())} of {campaign.fitted} groups"]
        lines += [f"  {count:>6}  {text}" for text, count in looks.most_common(_SHOWN)]
    if failures := [
        (key, row[FAILURE]) for key, row in zip(campaign.keys, campaign.rows, strict=True) if row[FAILURE]
    ]:
        lines += ["", f"failed: {len(failures)} group{'s' if len(failures) > 1 else ''}"]
        lines += [f"  {label(key)}: {reason}" for key, reason in failures[:_SHOWN]]
    if campaign.refused:
        lines += ["", f"refused: {len(campaign.refused)} file{'s' if len(campaign.refused) > 1 else ''}"]
        lines += [f"  {each.reason}" for each in campaign.refused[:_SHOWN]]
    return "\n".join(lines)


def counts(campaign: Campaign) -> str:
    """How many groups there are, and how many were fitted."""
    n = len(campaign.rows)
    groups = f"{n:,} group{'s' if n != 1 else ''} by {joined(campaign.by)}"
    return f"{groups}: {campaign.fitted:,} fitted by {campaign.method}, {campaign.failed:,} failed."


def warnings(campaign: Campaign) -> list[str]:
    """What must be known before the numbers are believed."""
    said = []
    if any(STAND_IN in str(row.get(PROVENANCE, "")) for row in campaign.rows):
        said.append(
            "Stand-ins are generated from constants a paper prints: a fit to them shows that the tool works "
            "and is no finding."
        )
    if not campaign.facts:
        said.append("Slips, effects and lack of fit were not looked for (--no-facts).")
    if campaign.unread:
        said.append(campaign.unread)
    return said


def remarks(campaign: Campaign) -> list[str]:
    """What must be known beside the numbers of the populations."""
    return [
        *mostly_open(campaign),
        *without_population(campaign),
        *cut_by_ends(campaign),
        *missed(campaign),
        *membership(campaign),
    ]


def membership(campaign: Campaign) -> list[str]:
    """Groups that are not of one population, by constant, and where that was not looked for."""
    two = [_two(each) for each in campaign.populations if each.two is not None]
    said = [_outlying(campaign, each) for each in campaign.populations if each.outlying]
    if said:
        said.append(
            "What is said of these constants takes all groups as of one population: see what sets these "
            "groups off, and make their campaign without them."
        )
    if two:
        said += [
            *two,
            "What is said of the median and of new groups takes two populations as one there, and pooled "
            "values are drawn to a middle where no group is: see what the groups of each have in common "
            "(NAME_upper_population of results.parquet), and make a campaign of each.",
        ]
    small = [each.name for each in campaign.populations if FEWEST < each.groups.size < FEWEST_OF_SEVERAL]
    if small:
        said.append(
            f"Whether {joined(small)} {'has' if len(small) == 1 else 'have'} two populations of groups, or "
            f"several groups that hide one another, is looked at from {FEWEST_OF_SEVERAL} groups on."
        )
    few = [each.name for each in campaign.populations if each.outlying is None]
    if few:
        said.append(
            f"Whether the groups are of one population in {joined(few)} cannot be told from {FEWEST} groups."
        )
    return said


def mostly_open(campaign: Campaign) -> list[str]:
    """Constants of which most groups give no more than a limit."""
    return [
        f"{each.name}: no population, as {each.limits} of {campaign.fitted} groups give no more than a limit "
        f"and {each.determined} a value; which ones do the constant itself decides."
        for each in campaign.mostly_open
    ]


def without_population(campaign: Campaign) -> list[str]:
    """Constants that are left open in so many groups that nothing is pooled, where others are."""
    pooled = {each.name for each in campaign.populations}
    said_already = {each.name for each in campaign.mostly_open}
    said = []
    for name in constants_of(campaign.rows) if pooled else ():
        found = Counter(row.get(f"{name}_status") for row in campaign.rows)
        if name not in pooled | said_already and "fixed" not in found:
            said.append(
                f"{name}: {found['determined']} of {campaign.fitted} groups determine it, and a population "
                f"takes {FEWEST}: none is made."
            )
    return said


def cut_by_ends(campaign: Campaign) -> list[str]:
    """Ends of domains that may have moved a population, by constant, and what to do."""
    said, of = [], dict.fromkeys(each.constant for found in campaign.populations for each in found.cut)
    for found in campaign.populations:
        for each in found.cut:
            whose = "its own domain" if each.constant == found.name else f"the domain of {each.constant}"
            said.append(
                f"{found.name}: the end {each.end:g} of {whose} cuts what {each.groups} of {campaign.fitted} "
                "groups say, once for each: the median group may be off by up to some "
                f"{each.shift:.1f} times its standard error."
            )
    if said:
        said.append(
            "Where groups are alike, fit their rows at once, as by fit without --by; or measure so closely "
            f"that no end matters; or fix {joined(list(of), 'or')} where it is known."
        )
    return said


def missed(campaign: Campaign) -> list[str]:
    """Groups that are not pooled and may have moved a population by that, by constant, and what to do."""
    said, of = [], []
    for found in campaign.populations:
        if (each := found.missed) is None:
            continue
        counted = (each.above, "above"), (each.below, "below"), (each.two_sided, "to two sides")
        sides = joined([f"{count} {side}" for count, side in counted if count])
        off = "low" if each.shift > 0.0 else "high"
        of.append(found.name)
        said.append(
            f"{found.name}: {each.groups} of {campaign.fitted} groups leave it open ({sides}) and are not "
            f"pooled. Where its own value is why, the median group is too {off} by up to some "
            f"{abs(each.shift):.1f} times its standard error, and groups differ by more."
        )
    if said:
        said.append(
            f"What is said of {joined(of)} is of the groups that determine it: measure the others so that "
            "they do (mu: at angles at which they slide), or take it for these groups alone."
        )
    return said


def _two(found: Population) -> str:
    assert found.two is not None
    (few, many), (low, high) = found.two.sizes, found.medians_of_two
    return (
        f"{found.name}: two populations describe the groups better than one (p {p_text(found.two.p_value)}): "
        f"{few} groups about {low:.3g} and {many} about {high:.3g}."
    )


def _outlying(campaign: Campaign, found: Population) -> str:
    assert found.outlying is not None
    named = [f"{label(campaign.keys[at])} (p {p_text(p)})" for at, p in found.outlying.items()]
    more = [f"{len(named) - _SHOWN} more"] if len(named) > _SHOWN else []
    verb = "is" if len(named) == 1 else "are"
    return f"{found.name}: not of the population of the others {verb} {joined([*named[:_SHOWN], *more])}."


def between(low: float, high: float, middle: float | None = None) -> str:
    """An interval, behind its middle where that is given, with the digits that its width deserves."""
    width = high - low
    digits = decimals(width) if width > 0.0 else 3
    ends = f"[{fixed(low, digits)}, {fixed(high, digits)}]"
    return ends if middle is None else f"{fixed(middle, digits)} {ends}"
