"""Registries: what can be plugged into the package, by name.

A kind of entry (a closure, an observable, an effect, ...) has one `Registry`, which lives beside the type of
its entries. `register` puts an entry into the registry of its type; packages do the same through the
entry-point group ``ifrfit``, see `load_entry_points`.
"""

from __future__ import annotations

import difflib
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import entry_points
from typing import Protocol, TypeVar

from ifrfit.errors import UsageError

GROUP = "ifrfit"

# The modules that hold a registry, by name only: this module stands below them, and `register` imports one
# when an entry is none of the kinds that are known so far.
_HOMES = (
    "ifrfit.physics.closures",
    "ifrfit.physics.observables",
    "ifrfit.physics.effects.registry",
    "ifrfit.data.figures.importers",
    "ifrfit.inference.model.error_law",
    "ifrfit.inference.estimators",
    "ifrfit.exporters.registry",
    "ifrfit.report.page.registries",
)


class Named(Protocol):
    """What every entry has."""

    @property
    def name(self) -> str:
        """Its name on the command line and in result files."""


T = TypeVar("T", bound=Named)


class Registry(Mapping[str, T]):
    """Entries of one kind by name, in the order in which they were added.

    Listing the entries, or looking for one that is not there, first loads the packages that plug in through
    the entry-point group ``ifrfit``.

    Parameters
    ----------
    kind : str
        What an entry is, in messages: "closure".
    entry_type : type
        Class of the entries, or a `typing.Protocol` that can be checked at run time.
    entries : iterable, optional
        The package's own.
    check : callable, optional
        Raises `UsageError` for an entry that cannot be used; asked of those that are added later. The
        package's own are checked by its tests.
    order : callable, optional
        From an entry to its place in the listing, where that is not the order of addition.

    Notes
    -----
    Nothing may be derived from a registry when a module is imported: entries that come later would miss.
    """

    def __init__(
        self,
        kind: str,
        entry_type: type,
        entries: Iterable[T] = (),
        *,
        check: Callable[[T], None] | None = None,
        order: Callable[[T], int] | None = None,
    ) -> None:
        self.kind = kind
        self._entry_type = entry_type
        self._check = check
        self._order = order
        self._entries: dict[str, T] = {}
        for entry in entries:
            self._put(entry)
        self._own = frozenset(self._entries)
        _REGISTRIES.append(self)

    @property
    def added(self) -> tuple[T, ...]:
        """Entries beside the package's own."""
        return tuple(entry for name, entry in self.items() if name not in self._own)

    def accepts(self, entry: object) -> bool:
        """Whether this is the registry for `entry`."""
        return isinstance(entry, self._entry_type)

    def add(self, entry: T, *, replaces: bool = False) -> T:
        """Add an entry.

        Parameters
        ----------
        entry : T
        replaces : bool
            Whether it takes the place of one of the same name that was added before.

        Raises
        ------
        UsageError
            If the name is taken or not a word of lower case, or the entry cannot be used.
        """
        if self._check is not None:
            self._check(entry)
        self._put(entry, replaces=replaces and entry.name not in self._own)
        return entry

    def _put(self, entry: T, *, replaces: bool = False) -> None:
        name = entry.name
        if not name or name != name.strip().lower() or any(letter.isspace() for letter in name):
            raise UsageError(
                f"'{name}' cannot be the name of a {self.kind}: take lower case, without white space."
            )
        if name in self._entries and not replaces:
            raise UsageError(f"There is a {self.kind} '{name}' already: give this one another name.")
        self._entries[name] = entry
        if self._order is not None:
            self._entries = {each.name: each for each in sorted(self._entries.values(), key=self._order)}

    def remove(self, name: str) -> None:
        """Take an entry out again.

        Raises
        ------
        UsageError
            If there is none of that name.
        """
        del self._entries[self[name].name]

    def __getitem__(self, name: str) -> T:
        """Look an entry up.

        Raises
        ------
        UsageError
            If there is none of that name: the text lists those there are.
        """
        if name not in self:
            raise UsageError(self.unknown(name))
        return self._entries[name]

    def get(self, name: str, default: T | None = None) -> T | None:  # type: ignore[override]
        """The entry of that name, or `default`."""
        return self._entries[name] if name in self else default

    def unknown(self, name: str) -> str:
        """Say that there is no entry `name`, which ones there are, and which one may be meant."""
        near = difflib.get_close_matches(str(name).lower(), list(self), n=1)
        meant = f" Did you mean {near[0]}?" if near else " One of your own is known once it is registered."
        return f"There is no {self.kind} '{name}'. Choose one of {', '.join(self)}.{meant}"

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str):
            return False
        if name not in self._entries:
            load_entry_points()
        return name in self._entries

    def __iter__(self) -> Iterator[str]:
        load_entry_points()
        return iter(tuple(self._entries))

    def __len__(self) -> int:
        load_entry_points()
        return len(self._entries)


_REGISTRIES: list[Registry] = []  # type: ignore[type-arg]
_loaded = False


def register(entry: T) -> T:
    """Plug something into the package: from then on it is known by its name like the package's own.

    Registered again, as where a notebook's cell runs twice, the last one counts.

    Parameters
    ----------
    entry : Closure, Observable, Effect, Estimator, ...
        Its type says what it is.

    Returns
    -------
    The entry
        Unchanged.

    Raises
    ------
    UsageError
        If it is no kind of entry, if its name is that of one of the package's own, or if it cannot be used.

    Examples
    --------
    >>> import ifrfit
    >>> from ifrfit.physics.closures import CLOSURES
    >>> list(CLOSURES)
    ['f', 'fr', 'ifr', 'ifr-contact', 'maw']
    >>> ifrfit.register(3)
    Traceback (most recent call last):
        ...
    ifrfit.errors.UsageError: int is nothing that can be registered: it is no closure, observable, ...
    """
    return _registry_of(entry).add(entry, replaces=True)


@contextmanager
def registered(*entries: T) -> Iterator[None]:
    """Have entries registered inside a ``with`` block only."""
    added: list[T] = []
    try:
        for entry in entries:
            added.append(_registry_of(entry).add(entry))
        yield
    finally:
        for entry in reversed(added):
            _registry_of(entry).remove(entry.name)


def _registry_of(entry: T) -> Registry[T]:
    for home in (None, *_HOMES):
        if home is not None:
            import_module(home)
        for registry in _REGISTRIES:
            if registry.accepts(entry):
                return registry
    kinds = ", ".join(registry.kind for registry in _REGISTRIES)
    raise UsageError(f"{type(entry).__name__} is nothing that can be registered: it is no {kinds}.")


def load_entry_points() -> None:
    """Register what installed packages offer in the entry-point group ``ifrfit``; once in a process.

    An entry point names an entry, or a tuple or list of entries. One that cannot be loaded is left out with a
    warning that names it, so that a broken package does not stop the others.
    """
    global _loaded
    if _loaded:
        return
    _loaded = True  # first: what is loaded may itself look into a registry
    for point in entry_points(group=GROUP):
        try:
            found = point.load()
            for entry in found if isinstance(found, tuple | list) else (found,):
                register(entry)
        except Exception as error:  # noqa: BLE001 whatever a foreign package raises
            warnings.warn(
                f"The entry point '{point.name}' ({point.value}) of group {GROUP} is left out: "
                f"{type(error).__name__}: {error}",
                stacklevel=2,
            )
