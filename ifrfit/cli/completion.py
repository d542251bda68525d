"""What a shell may offer for a word that is being typed; nothing is imported before it is asked for."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ifrfit.cli.parameters import Complete
from ifrfit.inference.option_fields import Choices, Form

_TABLES = (".csv", ".tsv", ".txt", ".dat", ".parquet", ".pq")


def completer(choices: Choices, form: Form = "text") -> Complete:
    """Offers some words.

    Parameters
    ----------
    choices : callable
        Gives them.
    form : str
        How they are written: in lists the last word is completed, behind a constant an equals sign stands.
    """

    def complete(incomplete: str) -> list[str]:
        before, comma, _ = incomplete.rpartition(",") if form == "words" else ("", "", "")
        after = "=" if form in ("values", "pairs") else ""
        return [f"{before}{comma}{word}{after}" for word in choices()]

    return complete


def complete_data(incomplete: str) -> list[str]:
    """Datasets, and tables that lie here; where nothing begins so the shell offers all files by itself."""
    from ifrfit.data.catalogue import dataset_names

    return [*dataset_names(), *_files(incomplete, _TABLES)]


def complete_dataset(incomplete: str) -> list[str]:
    """Datasets."""
    from ifrfit.data.catalogue import dataset_names

    return list(dataset_names())


def _files(incomplete: str, endings: Iterable[str]) -> list[str]:
    """Files that begin so, as they are typed."""
    folder, slash, _ = incomplete.rpartition("/")
    place = Path(f"{folder}{slash}" or ".").expanduser()
    if not place.is_dir():
        return []
    names = sorted(path.name for path in place.iterdir() if path.suffix.lower() in endings)
    return [f"{folder}{slash}{name}" for name in names]
