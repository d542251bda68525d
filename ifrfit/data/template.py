"""Tables to fill in, with the rules as comments."""

from __future__ import annotations

# No double quotes and no cell that is a sentence with a quote: a spreadsheet would put '"' before the '#'.
_DERIVED = """\
# ifrfit template: impacts of a sphere on a fixed wall, one impact a line.
# Lines that begin with '#' are passed over; these rules may stay in the file.
#
# To try it: take away the '#' of the example lines at the end, save, and run
#     ifrfit fit FILE.csv
# Then put your own impacts in the place of the examples.
#
# Columns. Needed are gamma_deg and at least one observable, such as beta.
#   gamma_deg    incidence angle in degrees from the wall's normal: 0 is head-on,
#                90 is grazing. If yours is measured from the wall, call the column
#                alpha_deg and add --convention angle=from-wall to the command.
#   beta         tangential restitution of the contact point, -V_t/U_t (after over
#                before), with its sign: positive if the contact point turns back.
#   e_n          normal restitution, -v_z/u_z (after over before), positive.
#                beta alone cannot tell e_n from mu: it gives e_t and mu (1 + e_n).
#                Without a column e_n, give its value to the command: --fix e_n=0.94
#   sigma_beta   standard uncertainty of beta, sigma_e_n of e_n, and so on. Leave the
#                column out if you do not know it: the scatter then tells.
#   spin_y       spin before the impact as R omega_y/u (radius R, incoming speed u),
#                positive for back-spin, negative for top-spin. Leave out: no spin.
#   speed_m_s    incoming speed u. May be left out.
#   provenance   measured, digitised or simulated. May be left out.
# Other observables, each in a column of its own name:
#   beta_cm      -v_x/u_x of the centre of the sphere
#   delta_deg    rebound angle of the centre from the normal, degrees
#   mu_app       tangential over normal impulse, P_x/P_n
#   spin_y_after R Omega_y/u after the impact
# Further columns: series (a name for each run), impact_id, sigma_gamma_deg.
#
# An empty cell means: not measured. The order of the columns is free.
# Other units go into the header: gamma [rad], speed (mm/s), delta_rad.
# Commas, semicolons or tabs part the columns; with semicolons or tabs the numbers
# may have decimal commas.
gamma_deg,beta,sigma_beta,e_n,sigma_e_n,spin_y,speed_m_s,provenance
"""
# From the closure with e_n = 0.94, e_t = -0.98, mu = 0.12 and normal noise of the sigmas stated.
_DERIVED_ROWS = (
    "10,0.45,0.03,0.92,0.02,0,2.03,simulated",
    "20,0.40,0.03,0.95,0.02,0,2.01,simulated",
    "30,0.37,0.03,,,0,1.99,simulated",
    "40,-0.01,0.03,0.93,0.02,0,1.98,simulated",
    "50,-0.25,0.03,0.95,0.02,0,2.01,simulated",
    "60,-0.53,0.03,0.96,0.02,0,1.95,simulated",
    "70,-0.66,0.03,0.94,0.02,0,1.97,simulated",
    "80,-0.86,0.03,,,0,1.96,simulated",
)
_RAW = """\
# ifrfit template: velocities and spins of a sphere before and after it hits a fixed
# wall, one impact a line.
# Lines that begin with '#' are passed over; these rules may stay in the file.
#
# To try it: take away the '#' of the example lines at the end, save, and run
#     ifrfit fit FILE.csv
# Then put your own impacts in the place of the examples.
#
# Frame, right-handed
#   z   into the wall: u_z is positive, v_z is negative
#   x   along the wall, the way the sphere comes in: u_x is positive or zero
#   y   completes the frame. Spins are right-handed: positive omega_y is back-spin
#
# Columns
#   u_x_m_s, u_z_m_s      velocity of the centre before the impact
#   v_x_m_s, v_z_m_s      and after it
#   omega_y_rad_s         spin before the impact; leave out if it was not measured,
#                         it is taken as 0
#   omega_y_after_rad_s   and after it; leave out if it was not measured
#   radius_mm             of the sphere, or diameter_mm; only needed with spins
#   provenance            measured, digitised or simulated; may be left out
# Further columns, if you have them:
#   u_y_m_s, v_y_m_s                   motion that is not along x
#   omega_x_rad_s, omega_x_after_rad_s spin about x
#   sigma_v_x_m_s, sigma_v_z_m_s, ...  standard uncertainty of a column
#   series (a name for each run), impact_id
# For another body than a homogeneous sphere add, say, --inertia-factor 0.667 to the
# command (thin hollow ball).
#
# An empty cell means: not measured. The order of the columns is free.
# Units stand in the headers: m_s, mm_s, rad_s, rpm, m, mm.
# Commas, semicolons or tabs part the columns; with semicolons or tabs the numbers
# may have decimal commas.
u_x_m_s,u_z_m_s,omega_y_rad_s,v_x_m_s,v_z_m_s,omega_y_after_rad_s,radius_mm,provenance
"""
# From the closure with the same constants, u near 2 m/s and normal noise of 1 % of u on all that is after.
_RAW_ROWS = (
    "0.27,1.91,0,0.19,-1.80,-58,5,simulated",
    "0.56,1.94,0,0.33,-1.80,-115,5,simulated",
    "0.81,1.82,0,0.50,-1.73,-169,5,simulated",
    "1.00,1.61,0,0.64,-1.55,-189,5,simulated",
    "1.33,1.47,0,0.98,-1.35,-170,5,simulated",
    "1.63,1.27,0,1.34,-1.19,-155,5,simulated",
    "1.66,0.88,0,1.46,-0.81,-110,5,simulated",
    "1.94,0.56,0,1.77,-0.50,-71,5,simulated",
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
        Rules, header and examples, in lines of at most 88 characters; the examples are commented out
        (``#10,0.45,...``), so that they cannot be fitted by mistake, and marked as simulated.
    """
    head, rows = (_RAW, _RAW_ROWS) if raw else (_DERIVED, _DERIVED_ROWS)
    return head + "".join(f"#{row}\n" for row in rows)
