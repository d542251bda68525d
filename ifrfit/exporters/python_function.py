"""Target python: the fitted closure as a function that needs only ``math``."""

from __future__ import annotations

from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.impulse_terms import wall_function
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Translation

_TEXT = '''
import math

E_N = {e_n!r}
A, B, KAPPA = {a!r}, {b!r}, {kappa!r}
J = {j!r}


def rebound(u_x, u_y, u_n, spin_x=0.0, spin_y=0.0):
    """Velocity and spin after an impact: (v_x, v_y, v_n, spin_x, spin_y)."""
    slip_x, slip_y = u_x + spin_y, u_y + spin_x
    slip = math.hypot(slip_x, slip_y)
    k = A + (B if slip == 0.0 else min(B, KAPPA * u_n / slip))
    push_x, push_y = k * slip_x, k * slip_y
    return u_x - push_x, u_y - push_y, E_N * u_n, spin_x - push_y / J, spin_y - push_x / J
'''


@dataclass(frozen=True)
class PythonFunction:
    """The wall function in Python."""

    name: str = "python"
    title: str = "Python"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The function, and its own evaluation."""
        return wall_function(constants, self.name, _TEXT)


EXPORTER = PythonFunction()
