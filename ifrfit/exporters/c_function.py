"""Target c: the fitted closure as a C99 function that needs only ``math.h``."""

from __future__ import annotations

from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.impulse_terms import wall_function
from ifrfit.exporters.protocol import IN_C, Comments, Conditions, Translation

_TEXT = """
#include <math.h>

#define IFRFIT_E_N ({e_n!r})
#define IFRFIT_A ({a!r})
#define IFRFIT_B ({b!r})
#define IFRFIT_KAPPA ({kappa!r})
#define IFRFIT_J ({j!r})

typedef struct {{ double v_x, v_y, v_n, spin_x, spin_y; }} ifrfit_state;

/* velocity and spin after an impact */
static inline ifrfit_state ifrfit_rebound(double u_x, double u_y, double u_n, double spin_x, double spin_y)
{{
    const double slip_x = u_x + spin_y, slip_y = u_y + spin_x;
    const double slip = hypot(slip_x, slip_y);
    const double friction = slip == 0.0 ? IFRFIT_B : IFRFIT_KAPPA * u_n / slip;
    const double k = IFRFIT_A + (friction < IFRFIT_B ? friction : IFRFIT_B);
    const double push_x = k * slip_x, push_y = k * slip_y;
    const ifrfit_state after = {{ u_x - push_x, u_y - push_y, IFRFIT_E_N * u_n,
                                 spin_x - push_y / IFRFIT_J, spin_y - push_x / IFRFIT_J }};
    return after;
}}
"""


@dataclass(frozen=True)
class CFunction:
    """The wall function in C."""

    name: str = "c"
    title: str = "C"
    comments: Comments = IN_C
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The function; its arithmetic is that of the closure, which the tests compile and compare."""
        return wall_function(constants, self.name, _TEXT)


EXPORTER = CFunction()
