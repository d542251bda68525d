"""Tables to fill in, with the rules as comments."""

from __future__ import annotations

_DERIVED = """\
# One impact a line, a column for each observable. Lines that begin with '#' are passed over.
# gamma_deg      incidence angle from the wall's normal, degrees, 0 to 90. Measured from the wall instead?
#                Call the column alpha_deg and say --convention angle=from-wall
# beta           -V_t/U_t of the contact point, with its sign. Other observables: beta_cm (-v_x/u_x of the
# centre),                e_n, mu_app, delta_deg (rebound angle of the centre), spin_y_after (R Omega_y/u),
# ... sigma_beta     its standard uncertainty; leave it empty, or leave the column out, if it is not known e_n
# -v_z/u_z. beta alone gives e_t and mu (1 + e_n); e_n, or --fix e_n=..., parts mu from it spin_y         R
# omega_y/u before the impact, positive for back-spin; leave the column out without spin speed_m_s
# incoming speed u An empty cell means "not measured". Separate columns by commas, semicolons or tabs; decimal
# commas are understood behind semicolons and tabs. Any unit can stand in the header: gamma [rad], speed
# (mm/s). Remove the '#' of the three example lines to see how it works, then put your own impacts in their
# place.
gamma_deg,beta,sigma_beta,e_n,sigma_e_n,spin_y,speed_m_s
"""
# From the closure with e_n = 0.94, e_t = -0.98, mu = 0.12, not measured.
_DERIVED_ROWS = (
    "10,0.42,0.03,0.94,0.02,0,3.9",
    "35,0.18,0.03,0.93,0.02,0,3.9",
    "60,-0.51,0.03,,,0,3.8",
)
_RAW = """\
# One impact a line: velocities and spins of the sphere before and after. Lines that begin with '#' are passed
# over. Frame          z points into the wall, x along the wall in the direction of the incoming motion, y
# completes a                right-handed frame; spins are right-handed: positive omega_y is back-spin. u_x,
# u_z       velocity before (u_z > 0); add u_y_m_s if the motion is not along x v_x, v_z       velocity after
# (v_z < 0); add v_y_m_s, omega_x_rad_s, omega_x_after_rad_s for lateral spin omega_y        spin before and
# (omega_y_after) after, rad/s or rpm: leave the columns out if it was not measured radius_mm      of the
# sphere; or diameter_mm. Needed with spins only Uncertainties  add columns such as sigma_v_x_m_s,
# sigma_omega_y_after_rad_s An empty cell means "not measured". Units stand in the headers: m_s, mm_s, rad_s,
# rpm, m, mm. Remove the '#' of the two example lines to see how it works, then put your own impacts in their
# place.
u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,v_z_m_s,omega_y_after_rad_s,radius_mm
"""
# Made from the closure itself (e_n = 0.94, kappa = 0.2328), so that angular momentum closes.
_RAW_ROWS = (
    "1.0,2.0,0,0.5943,-1.88,-202.86,5",
    "2.0,1.0,0,1.7558,-0.94,-122.12,5",
)


def template_text(raw: bool = False) -> str:
    """Return a commented CSV to fill in.

    Parameters
    ----------
    raw : bool
        Velocities and spins before and after instead of observables.

    Returns
    -------
    str
        Header and rules; the example rows are commented out (``#10,0.42,...``), so that they cannot be fitted
        by mistake.
    """
    head, rows = (_RAW, _RAW_ROWS) if raw else (_DERIVED, _DERIVED_ROWS)
    return head + "".join(f"#{row}\n" for row in rows)
