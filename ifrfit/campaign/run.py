"""`run_campaign`: the groups of many files, each fitted by itself, and the population they come from."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from ifrfit.campaign.group_fit import FAILURE, GroupQuestion, Row
from ifrfit.campaign.journal import Journal
from ifrfit.campaign.many_groups.plain_groups import fit_groups, groups_at_once
from ifrfit.campaign.population.limits import MostlyOpen
from ifrfit.campaign.population.partial_pooling import Population, populations
from ifrfit.campaign.population.repeated_priors import bounds_reason, prior_reason
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.groups import Group, GroupedFiles, RefusedFile
from ifrfit.data.table_folders import path_of, table_files
from ifrfit.errors import DataError, UsageError
from ifrfit.inference.estimator import Estimator
from ifrfit.inference.keywords import estimator_of, model_of, noise_of, selection_of
from ifrfit.inference.options import Model, Noise
from ifrfit.inference.workers.crews import TRIES, Crew
from ifrfit.inference.workers.lots import in_lots
from ifrfit.physics.closures import get_closure
from ifrfit.physics.effects.contact import SOLID

EMPTY = "(empty)"  # what stands for the text of an empty cell in a label
METHODS = ("exact", "lsq", "profile")
_KEPT_EVERY = 0.5  # s: what is lost, at most, where a campaign is killed
DIED = f"the process that fitted it died {TRIES} times, as for want of memory. Fit the group by itself."


def label(key: Sequence[str]) -> str:
    """What a group is called where people read it."""
    return ", ".join(part or EMPTY for part in key)


@dataclass(frozen=True)
class Campaign:
    """What was found of all groups.

    Attributes
    ----------
    by : tuple of str
        Columns that formed the groups.
    keys : tuple of tuple of str
        Of each group, in the order in which they were read.
    rows : tuple of dict
        Of each group, see `ifrfit.campaign.group_fit.fit_group`.
    refused : tuple of RefusedFile
    populations : tuple of Population
    mostly_open : tuple of MostlyOpen
        Constants of which most groups give no more than a limit.
    no_population : str
        Why none was pooled, where knowledge of the user's would count once a group; else empty.
    unread : str
        What of an unfinished campaign could not be read, and was fitted anew; else empty.
    model : Model
    method : str
    noise : str or None
        As asked; None is the default of each group.
    facts : bool
        Whether slips, effects and lack of fit were looked for.
    seed : int
    command : str
    """

    by: tuple[str, ...]
    keys: tuple[tuple[str, ...], ...]
    rows: tuple[Row, ...]
    refused: tuple[RefusedFile, ...]
    populations: tuple[Population, ...]
    mostly_open: tuple[MostlyOpen, ...]
    no_population: str
    unread: str
    model: Model
    method: str
    noise: str | None
    facts: bool
    seed: int
    command: str

    @property
    def fitted(self) -> int:
        """Number of groups that have constants."""
        return sum(not row[FAILURE] for row in self.rows)

    @property
    def outlying(self) -> list[str]:
        """In which constants each row is not of the population of the others; empty where in none."""
        named: list[list[str]] = [[] for _ in self.rows]
        for each in self.populations:
            for at in each.outlying or {}:
                named[at].append(each.name)
        return [", ".join(names) for names in named]

    @property
    def failed(self) -> int:
        """Number of groups without."""
        return len(self.rows) - self.fitted


def run_campaign(
    data: Sequence[str | Path],
    by: Sequence[str],
    out: Path,
    deliver: Callable[[Campaign], list[str]],
    *,
    model: Model | None = None,
    noise: str | Noise | None = None,
    method: str | Estimator | None = None,
    facts: bool = True,
    crew: Crew | None = None,
    resume: bool = False,
    force: bool = False,
    seed: int = 0,
    command: str = "",
    progress: Callable[[int, int], None] | None = None,
    **keywords: Any,
) -> tuple[Campaign, list[str]]:
    """Fit every group of the files by itself, and all of them as members of one population.

    A group that cannot be fitted, and a file that cannot be read, are named in the result and stop nothing.

    Parameters
    ----------
    data : sequence of str or Path
        Files, and folders of CSV, TSV and Parquet files.
    by : sequence of str
        Columns whose text forms the groups, without blanks around; ``file`` stands for the name of the file,
        with its folders where names are not unique.
    out : Path
        Folder of the results; what was found so far is kept beside it until they are delivered.
    deliver : callable
        Writes the results; gives the names of the files.
    model, noise, method, seed, **keywords
        As `ifrfit.fit`; the method is one of `METHODS`.
    facts : bool
        Whether slips, effects and lack of fit are looked for in each group.
    crew : Crew, optional
        Who fits the groups, see `crew_of`; by default this process. The results do not depend on it.
    resume : bool
        Go on with an unfinished campaign.
    force : bool
        Throw an unfinished one away, unless `resume`.
    progress : callable, optional
        Called with the groups done, and how many are known of.

    Returns
    -------
    Campaign, list of str

    Raises
    ------
    UsageError
        For choices that do not exist, and for an unfinished campaign that nothing is said of.
    DataError
        There is no file, no group in them, or no group that can be fitted.
    """
    name = method if isinstance(method, str) else estimator_of(method).name
    if name not in METHODS:
        raise UsageError(f"--method {name}: campaigns take {', '.join(METHODS)}.")
    estimator = estimator_of(method)
    if model is not None and model.tie:
        raise UsageError("A campaign does not know --tie: leave it out, or fit each group by itself.")
    if keywords.get("covariance") is not None:
        raise UsageError(
            "A campaign knows no covariance, which ties groups: fit the rows that it is of together."
        )
    conventions = parse_conventions(keywords.pop("convention", ()))
    question = GroupQuestion(
        conventions, model_of(model, {}), noise_of(noise), estimator, keywords, seed, facts
    )
    selection_of(keywords)
    inertia = question.model.inertia_factor
    parameters = question.model.parameters(SOLID if inertia is None else inertia)
    paths = [path_of(each) for each in data]
    files = GroupedFiles(tuple(table_files(paths)), tuple(by), conventions, tuple(paths))
    asked = repr((tuple(str(path.resolve()) for path in paths), tuple(by), question))
    journal = Journal.open(out, asked, resume=resume, force=force)
    order: dict[tuple[str, ...], int] = {}
    refused: list[RefusedFile] = []
    found: dict[tuple[str, ...], Row] = {}

    def unknown() -> Iterator[Group]:
        for group in files.groups():
            if isinstance(group, RefusedFile):
                refused.append(group)
                continue
            order[group.key] = len(order)
            row = journal.known.get((group.key, group.digest))
            if row is None:
                yield group
            else:
                found[group.key] = row

    work = partial(fit_groups, question, files)
    waiting: list[tuple[Group, Row]] = []
    kept = time.monotonic()
    try:
        for group, row in in_lots(unknown(), work, _lost, crew, groups_at_once(question)):
            found[group.key] = row
            waiting.append((group, row))
            if time.monotonic() - kept > _KEPT_EVERY:
                _keep(journal, waiting)
                kept = time.monotonic()
            if progress is not None:
                progress(len(found), max(len(order), len(files.files)))
        if crew is not None:
            crew.let_go()
    except (DataError, UsageError, KeyboardInterrupt):
        if not (found or journal.known):
            journal.close()  # nothing to go on with
        raise
    finally:
        _keep(journal, waiting)
    if not found:
        if not journal.known:
            journal.close()
        reason = refused[0].reason if refused else "no file has a row"
        raise DataError(f"There is no group to fit: {reason}")
    keys = tuple(sorted(found, key=order.__getitem__))
    rows = tuple(found[key] for key in keys)
    if all(row[FAILURE] for row in rows):
        journal.close()
        raise DataError(_all_failed(keys, rows))
    reason = prior_reason(question.model, question.noise, parameters) or bounds_reason(rows, parameters)
    pooled, mostly_open = populations([] if reason else rows, parameters)
    campaign = Campaign(
        tuple(by),
        keys,
        rows,
        tuple(refused),
        tuple(pooled),
        tuple(mostly_open),
        reason,
        journal.unread,
        replace(question.model, closure=get_closure(question.model.closure).name),
        estimator.name,
        question.noise.policy,
        facts,
        seed,
        command,
    )
    written = deliver(campaign)
    journal.close()
    return campaign, written


def _keep(journal: Journal, waiting: list[tuple[Group, Row]]) -> None:
    if waiting:
        journal.add(
            [group.key for group, _ in waiting],
            [group.digest for group, _ in waiting],
            [row for _, row in waiting],
        )
        waiting.clear()


def _all_failed(keys: Sequence[tuple[str, ...]], rows: Sequence[Row]) -> str:
    """Why there is no result, by the reason that most groups have."""
    reasons = [str(row[FAILURE]) for row in rows]
    (most, count), *_ = Counter(reasons).most_common(1)
    first = label(keys[reasons.index(most)])
    others = f" and {count - 1} more" if count > 1 else ""
    whole = "The only group failed" if len(rows) == 1 else f"All {len(rows)} groups failed"
    return f"{whole}, and nothing is written. {first}{others}: {most}"


def _lost(group: Group) -> Row:
    return {"files": ", ".join(group.files), "rows": group.rows, FAILURE: DIED}
