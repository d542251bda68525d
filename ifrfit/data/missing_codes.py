"""Numbers that stand for "not measured": -999 and the like, refused where they are none of the rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ifrfit.data.cell_table import Cells

# 99 and 999 with a decimal 9 are written as codes, too; a code fills the width of a column
_CODES = np.array([99.0, 99.9, 99.99, 999.0, 999.9, 999.99, 9999.0, 9999.9, 99999.0, 999999.0])
# short ones may be values: they count where several cells hold exactly the same
_SHORT_CODES = np.array([9.0, 9.9, 9.99, 9.999, 9.9999])
_SEVERAL = 3
_FAR = 3.0  # times the largest other value from which a code is none of the rest


def refuse_missing_codes(cells: Cells, header: str, values: NDArray[np.float64]) -> None:
    """Refuse the first cell of a column that holds a code for "not measured".

    A number counts as a code where it is written in nines and is several times larger than every other
    value of its column; in a column of nothing else, where it is negative. One of the size of a value, as
    9.99, has to stand there at least three times.

    Parameters
    ----------
    cells : Cells
    header : str
    values : ndarray, (n,)
        As they stand in the file.

    Raises
    ------
    DataError
        With file, line, column and remedy.
    """
    size = np.abs(values)
    suspect = np.isin(size, _CODES)
    for code in _SHORT_CODES[np.isin(_SHORT_CODES, size)]:
        short = size == code
        if short.sum() >= _SEVERAL and (~short & np.isfinite(values)).any():
            suspect |= short
    if not suspect.any():
        return
    others = size[~suspect & np.isfinite(values)]
    if others.size:
        suspect &= size > _FAR * others.max()
    else:
        suspect &= values < 0.0
    cells.refuse_first(
        suspect,
        header,
        lambda row: (
            f"{values[row]:g} looks like a code for 'not measured', as every other value is far smaller. "
            "Leave such cells empty."
        ),
    )
