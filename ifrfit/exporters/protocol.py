"""What an exporter is: a target's name and comments, and how constants become its input."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.physics.angles import Incidence

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Conditions:
    """At which impact a target matches, where it cannot match everywhere.

    Attributes
    ----------
    angle : float or None
        Incidence angle, degrees.
    speed : float or None
        Normal speed of approach, m/s.
    """

    angle: float | None = None
    speed: float | None = None


@dataclass(frozen=True)
class Response:
    """What the target's law makes of impacts, per incoming speed.

    Attributes
    ----------
    v_n, v_x : ndarray, (n,)
        Velocity of the centre after: away from the wall, and along it.
    beta : ndarray, (n,), or None
        Restitution of the contact point; None where the target leaves the spin alone.
    """

    v_n: Array
    v_x: Array
    beta: Array | None = None


@dataclass(frozen=True)
class Translation:
    """A target's input, and what is said of it.

    Attributes
    ----------
    lines : sequence of str
        The input, without the comment block.
    law : str
        Which law the target follows, as a sentence.
    mapping : sequence of str
        How the constants become the target's numbers, a sentence each.
    holds : str
        Over which angles and speeds, as a sentence.
    response : callable or None
        The target's law, evaluated, integrated or run; None where the target holds constants only.
    how : str
        How the response came about: "evaluated", "integrated", "run".
    ran : str
        Version of the target that ran; empty where it did not.
    angles : sequence of float
        Incidence angles at which the response is asked for, degrees.
    """

    lines: Sequence[str]
    law: str
    mapping: Sequence[str]
    holds: str
    response: Callable[[Incidence], Response] | None = None
    how: str = "evaluated"
    ran: str = ""
    angles: Sequence[float] = field(default_factory=lambda: tuple(float(x) for x in range(1, 90)))


@dataclass(frozen=True)
class Comments:
    """How a target writes comments."""

    line: str
    opening: str = ""
    closing: str = ""


HASH = Comments("# ")
IN_C = Comments(" * ", "/*", " */")
NONE = Comments("")
SLASHES = Comments("// ")
IN_XML = Comments("  ", "<!--", "-->")
EXCLAMATION = Comments("! ")


@runtime_checkable
class Exporter(Protocol):
    """One target.

    Attributes
    ----------
    name : str
        On the command line, ``--to NAME``.
    title : str
        As the target calls itself.
    comments : Comments
        Unused where the exporter is a `WholeFile`.
    takes : frozenset of str
        Which of "angle" and "speed" mean something to it.
    """

    @property
    def name(self) -> str:
        """Word on the command line."""
        ...

    @property
    def title(self) -> str:
        """As the target calls itself."""
        ...

    @property
    def comments(self) -> Comments:
        """How it writes comments."""
        ...

    @property
    def takes(self) -> frozenset[str]:
        """Which conditions mean something to it."""
        ...

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The constants as the target's input.

        Raises
        ------
        UsageError
            For what the target does not take: a value that its code would stop at, a closure it cannot hold.
        """
        ...


@runtime_checkable
class WholeFile(Protocol):
    """An exporter whose file holds block and draws as data, not as comments."""

    def compose(
        self, constants: ExportedConstants, block: Sequence[str], draws: Mapping[str, Array] | None
    ) -> str:
        """The whole text."""
        ...
