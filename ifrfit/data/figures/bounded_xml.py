"""XML of strangers as a tree: no entities, nothing from outside, and limits on size, depth and count."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

from ifrfit.errors import DataError

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element  # a type alone: parsing is that of defusedxml

_DEEPEST = 50
_MOST_ELEMENTS = 500_000
_PORTION = 2**20  # bytes: a tag that is not closed is looked through again with each, and holds up any smaller one


class _InPortions(io.BytesIO):
    """Bytes that are read in portions of one size, whatever is asked for."""

    def read(self, size: int | None = -1) -> bytes:
        """The next portion."""
        return super().read(_PORTION)


def read_xml(raw: bytes, file: str, remedy: str) -> Element:
    """The root of an XML text.

    Parameters
    ----------
    raw : bytes
    file : str
    remedy : str
        A sentence for the user.

    Raises
    ------
    DataError
        It is no XML, is cut short, defines entities, or is larger or deeper than any project.
    """
    from xml.etree.ElementTree import ParseError

    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import iterparse

    root: Element | None = None
    depth = count = 0
    try:
        for event, element in iterparse(_InPortions(raw), events=("start", "end"), forbid_dtd=False):
            if event == "end":
                depth -= 1
                continue
            root = element if root is None else root
            depth, count = depth + 1, count + 1
            if depth > _DEEPEST or count > _MOST_ELEMENTS:
                what = f"is nested more than {_DEEPEST} deep" if depth > _DEEPEST else "has too many elements"
                raise DataError(f"{file}: {what}, which no project does. {remedy}")
    except DataError:
        raise
    except DefusedXmlException:
        raise DataError(f"{file}: defines entities, which no project does. {remedy}") from None
    except ParseError as error:
        line, character = error.position
        raise DataError(
            f"{file}, line {line}, character {character + 1}: no XML from here on, or cut short. {remedy}"
        ) from None
    except (LookupError, ValueError) as error:  # an encoding that nobody knows
        raise DataError(f"{file}: no XML ({str(error)[:80]}). {remedy}") from None
    if root is None:
        raise DataError(f"{file}: no XML. {remedy}")
    return root
