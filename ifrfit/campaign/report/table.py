"""The table of a campaign: a row a group, as Parquet."""

from __future__ import annotations

import pandas as pd

from ifrfit.campaign.group_fit import columns_of
from ifrfit.campaign.run import Campaign

_SHRUNK = ("lo95", "lo68", "median", "hi68", "hi95")


def results_table(campaign: Campaign) -> pd.DataFrame:
    """A row a group: its key, what its fit found, and each constant as the population has it.

    Returns
    -------
    DataFrame
        The columns that form the groups, then those of `ifrfit.campaign.group_fit.fit_group`, then
        ``NAME_pooled``, ``_pooled_lo95``, ``_lo68``, ``_hi68``, ``_hi95``, ``NAME_shrinkage`` and
        ``NAME_membership_p`` of each constant that was pooled, and ``NAME_upper_population``, the probability
        to be of the upper one where there are two; empty where a group has none. Last
        ``not_of_the_population``, the constants in which a group is not of the population of the others.
    """
    names = columns_of(campaign.rows)
    table = pd.DataFrame(list(campaign.rows), columns=names)
    texts = ("files", "failure", "findings", "look", "provenance")
    for name in names:
        if name in texts or name.endswith("_status"):
            table[name] = table[name].astype("string")
    for column in ("rows", "n", "n_sliding", "n_sticking", "dof"):
        if column in table:
            table[column] = table[column].astype("Int64")
    for place, name in enumerate(campaign.by):
        label = name if name not in names else f"key_{name}"
        table.insert(place, label, pd.Series([key[place] for key in campaign.keys], dtype="string"))
    pooled: dict[str, pd.Series] = {}
    for each in campaign.populations:
        for part in _SHRUNK:
            tail = "pooled" if part == "median" else f"pooled_{part}"
            pooled[f"{each.name}_{tail}"] = pd.Series(getattr(each.members, part), index=each.groups)
        pooled[f"{each.name}_shrinkage"] = pd.Series(each.shrinkage, index=each.groups)
        if each.membership_p is not None:
            members = pd.Series(each.membership_p, index=each.groups)
            limits = pd.Series(each.limit_p, dtype=float)
            pooled[f"{each.name}_membership_p"] = pd.concat([members, limits]) if limits.size else members
        if each.two is not None:
            pooled[f"{each.name}_upper_population"] = pd.Series(each.two.is_upper, index=each.groups)
    if any(each.membership_p is not None for each in campaign.populations):
        pooled["not_of_the_population"] = pd.Series(campaign.outlying, dtype="string")
    return pd.concat([table, pd.DataFrame(pooled, index=table.index)], axis=1)
