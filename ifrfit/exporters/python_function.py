"""Target python: the fitted closure as a function that needs only ``math``."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.impulse_terms import EVERYWHERE, LAW_WORDS, WALL_WORDS, impulse_terms
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Response, Translation
from ifrfit.physics.angles import Incidence

_TEXT = '''import math

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
        terms = impulse_terms(constants, self.name)
        text = _TEXT.format(
            e_n=constants.e_n, a=terms.a, b=terms.b, kappa=terms.kappa, j=constants.inertia_factor
        )

        def response(incidence: Incidence) -> Response:
            import numpy as np

            rows = zip(incidence.sine, incidence.cosine, strict=True)
            found = np.array([_rebound(constants, (terms.a, terms.b, terms.kappa), s, c) for s, c in rows])
            return Response(found[:, 1], found[:, 0], found[:, 2])

        return Translation(
            lines=["", *text.rstrip("\n").split("\n")],
            law=LAW_WORDS,
            mapping=[f"a, b and kappa = mu (1 + e_n) follow from the constants; {WALL_WORDS}."],
            holds=EVERYWHERE,
            response=response,
        )


def _rebound(
    constants: ExportedConstants, terms: tuple[float, float, float], u_x: float, u_n: float
) -> tuple[float, float, float]:
    """v_x, v_n and beta by the arithmetic of the exported text, without spin."""
    a, b, kappa = terms
    slip = math.hypot(u_x, 0.0)
    k = a + (b if slip == 0.0 else min(b, kappa * u_n / slip))
    v_x, spin_y = u_x - k * u_x, 0.0 - k * u_x / constants.inertia_factor
    return v_x, constants.e_n * u_n, -(v_x + spin_y) / u_x if u_x else math.nan


EXPORTER = PythonFunction()
