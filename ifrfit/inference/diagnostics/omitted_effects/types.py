"""What a result keeps of the scene of its data, and of every effect on it."""

from __future__ import annotations

from dataclasses import dataclass

VISIBLE = 3.1  # standard deviations: those of p = 0.001


@dataclass(frozen=True)
class SceneOfData:
    """What is known of the scene of the data, in words.

    Attributes
    ----------
    origin : str
        Dataset or scene file.
    body, wall : str
        As their source names them; may be empty.
    known : tuple of str
        Numbers that were taken, each with its source.
    unknown : tuple of str
        What is not known, and why.
    """

    origin: str
    body: str = ""
    wall: str = ""
    known: tuple[str, ...] = ()
    unknown: tuple[str, ...] = ()


@dataclass(frozen=True)
class EffectLine:
    """One effect on the scene of the data.

    Attributes
    ----------
    effect : str
        As in a scene's list of effects.
    criterion : str
        Symbol of the dimensionless number, such as ``V_s/V``; empty where it is not known.
    value, threshold : float or None
        The most critical one over the impacts, and where the effect begins to act: by the rule of thumb of
        its source, or by changing values by about the noise.
    met : bool or None
        Whether the number is beyond the threshold.
    change : float or None
        Change that the constants cannot take up, of the value in which it is largest beside the noise. None
        where it is not known, or where the effect decides whether the value exists.
    observable, unit : str
        Of `change`; unit ``deg`` or empty.
    signal : float or None
        Standard deviations by which the effect would stand out in all rows together; None as `change`, and
        where its law does not hold and gives a bound only.
    says : str
    """

    effect: str
    criterion: str = ""
    value: float | None = None
    threshold: float | None = None
    met: bool | None = None
    change: float | None = None
    observable: str = ""
    unit: str = ""
    signal: float | None = None
    says: str = ""

    @property
    def visible(self) -> bool:
        """Whether the effect acts, and these data would show it."""
        return bool(self.met) and self.signal is not None and self.signal >= VISIBLE
