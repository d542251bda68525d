"""Tables to fill in, with the rules as comments: template.csv and template_raw.csv beside this file.

The examples are simulated with e_n = 0.94, e_t = -0.98, mu = 0.12 and normal noise: of the sigmas stated, or
of 1 % of u, near 2 m/s, on all that is after. There are no double quotes in them, and no cells that are
sentences with quotes: a spreadsheet would put '"' before the '#'.
"""

from __future__ import annotations

from importlib.resources import files


def template_text(raw: bool = False) -> str:
    """Return a commented CSV to fill in.

    Parameters
    ----------
    raw : bool
        Velocities and spins before and after instead of observables.

    Returns
    -------
    str
        Rules, header and examples, in lines of at most 88 characters; the examples are commented out
        (``#10,0.45,...``), so that they cannot be fitted by mistake, and marked as simulated.
    """
    name = "template_raw.csv" if raw else "template.csv"
    return files("ifrfit.data").joinpath(name).read_text(encoding="utf-8")
