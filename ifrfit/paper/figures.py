"""What each figure of the paper shows: one table of every choice."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ifrfit.paper.axes import (
    CONTACT,
    FROM_NORMAL,
    LATERAL_SPIN,
    RATIO,
    TANGENT,
    Ordinate,
)
from ifrfit.paper.elastic_plastic import ElasticPlastic
from ifrfit.paper.figure import PaperFigure
from ifrfit.paper.given_curves import Model, Setting, deviation_as_printed, total_as_printed
from ifrfit.paper.scene import Pen
from ifrfit.report.style import COLOURS

PRINTED_PEN = Pen("black", (0, (5, 1.6)), 1.1)
_THIN = Pen(COLOURS[1], (0, (1.2, 1.6)), 1.0)
_MISPRINT = Pen(COLOURS[1], (0, (4, 2)), 0.8)


def constants_words(constants: Mapping[str, float]) -> str:
    """Values of e_n, e_t and mu with true minus signs."""
    symbols = {"e_n": "$e_n$", "e_t": "$e_t$", "mu": "μ"}
    return ", ".join(f"{symbols[name]} {value:.2f}".replace("-", "−") for name, value in constants.items())


def _printed(e_n: float, e_t: float, mu: float) -> Model:
    constants = {"e_n": e_n, "e_t": e_t, "mu": mu}
    return Model(constants, f"printed: {constants_words(constants)}", "printed_constants", PRINTED_PEN)


_CROSS = _printed(0.94, -0.98, 0.12)
_CROSS_SPIN = _printed(0.94, -0.98, 0.14)
_BUCK = _printed(0.78, -0.80, 0.01)
_REAGLE = _printed(0.38, -0.95, 0.10)
_LATERAL = _printed(0.90, -0.90, 0.15)
_NO_SPIN = (Setting("no spin"),)
_BETA = Ordinate("beta", -1.0, 0.75)

# the paper draws four values of e_t in Fig. 9 and prints none of them: these are our choice
OWN_E_T = (-0.99, -0.96, -0.94)


def _with_e_t(e_t: float, colour: str, dashes: tuple[int, tuple[float, ...]], label: str) -> Model:
    return replace(
        _CROSS,
        constants={**_CROSS.constants, "e_t": e_t},
        label=label,
        kind="other",
        pen=Pen(colour, dashes, 0.9),
    )


_E_T_LINES = tuple(
    _with_e_t(e_t, colour, dashes, f"$e_t$ {e_t:.2f} (our choice of value)".replace("-", "−"))
    for e_t, colour, dashes in zip(
        OWN_E_T,
        (COLOURS[2], COLOURS[1], COLOURS[3]),
        ((0, (3, 1, 1, 1)), (0, (6, 1, 1, 1, 1, 1)), (0, (2, 1))),
        strict=True,
    )
)

PAPER = (
    PaperFigure(
        "1",
        "Oblique impact with arbitrary spin",
        "scheme",
        says="Oblique impact of a sphere with arbitrary spin, seen along y, along x and along z.",
        uses="(3), (4) with the spin before, (14)-(22), drawn to scale",
        note="Our own drawing: its arrows are a computed impact, listed in fig1.csv.",
    ),
    PaperFigure(
        "2",
        "Restitution and friction as separate elements",
        "scheme",
        says="Springs and dashpots as the usual picture of a contact.",
        uses="none",
        note="Our own drawing; it holds no numbers, and fig2.csv no rows.",
    ),
    PaperFigure(
        "3",
        "Steel ball on granite, no spin",
        "points",
        "cross-2019-no-spin",
        y=_BETA,
        settings=_NO_SPIN,
        models=(
            _CROSS,
            replace(_CROSS_SPIN, label="with μ 0.14, as Fig. 6 prints it", kind="other", pen=_THIN),
        ),
        says="beta against the angle, Cross (2019), no spin; Eq. (26) in sticking and (27) in sliding.",
        uses="(27) in sticking, (26) in sliding: the caption has them the wrong way round",
        note="mu is printed as 0.12 here and as 0.14 in Fig. 6 for the same ball and block: both are drawn.",
    ),
    PaperFigure(
        "4a",
        "Alumina granules on glass",
        "points",
        "buck-2017",
        y=Ordinate("beta", -0.65, 1.05, -1.0),
        settings=_NO_SPIN,
        models=(
            _BUCK,
            replace(
                _BUCK,
                label="printed, for values that are the centre's (Eq. 29)",
                kind="other",
                pen=_THIN,
                observable="beta_cm",
            ),
        ),
        says="Minus beta against the angle, Buck et al. (2017); Eq. (27), sliding.",
        uses="(26), since all points slide; (29) if the experiment reports the centre's coefficient",
        note="The paper lists this experiment among those that use the centre's velocity as well. With the "
        "printed constants the two readings part at grazing incidence: 0.80 against 0.94.",
    ),
    PaperFigure(
        "4b",
        "Steel ball on steel",
        "points",
        "hashemnia-2019",
        RATIO,
        Ordinate("beta", -1.0, 0.75, -1.0),
        _NO_SPIN,
        (_printed(0.60, -0.75, 0.15),),
        says="Minus beta against U_t/U_n, Hashemnia & Askari (2019); Eq. (27), sliding.",
        uses="(27) up to U_t/U_n = 0.600, (26) above",
    ),
    PaperFigure(
        "5",
        "Road dust on stainless steel, 27 m/s",
        "points",
        "reagle-2013",
        y=Ordinate("beta_tot", 0.2, 1.05),
        settings=(Setting("27 m/s"),),
        models=(
            _REAGLE,
            replace(
                _REAGLE,
                label="as the text has it, with β for $\\beta_\\mathrm{CM}$",
                kind="as_printed",
                pen=_MISPRINT,
                misprint=total_as_printed,
            ),
            ElasticPlastic(
                _REAGLE.constants,
                "elastic-plastic $e_n$ of quartz on steel: ours, not Yu & Tafti's",
                "other",
                _THIN,
            ),
        ),
        says="beta_tot against the angle, Reagle et al. (2013), with predictions of Yu & Tafti (2016); Eqs "
        "(28) and (29).",
        uses="beta_tot with beta_cm from (28) in sticking and (29) in sliding",
        note="The predictions of Yu & Tafti (triangles in the paper) are left out: their equations are not "
        "openly published. The dotted line is not their model but ours: the printed e_t and mu with the e_n "
        "of an elastic, perfectly plastic impact (Thornton 1997) of quartz, 30 um, on stainless steel at 27 "
        "m/s.",
    ),
    PaperFigure(
        "6",
        "Steel ball on granite, two spins",
        "points",
        "cross-2019-spin",
        y=_BETA,
        settings=(Setting("spin 0.225", 0.0, 0.225), Setting("spin 0.833", 0.0, 0.833)),
        models=(
            _CROSS_SPIN,
            replace(_CROSS, label="with μ 0.12, as Fig. 3 prints it", kind="other", pen=_THIN),
        ),
        says="beta against the angle, Cross (2019), with back-spin R omega_y/u = 0.225 and 0.833; Eq. (26) "
        "in sticking and (27) in sliding.",
        uses="(27) in sticking, (26) in sliding; with spin 0.833 all impacts slide",
        note="One e_t and one mu for both spins. The printed spreads of speed and spin let R omega_y/u be "
        "0.12 to 0.40 and 0.48 to 1.67.",
    ),
    PaperFigure(
        "7",
        "Glass beads on steel",
        "points",
        "wang-2020",
        y=Ordinate("delta_deg", 0.0, 90.0),
        settings=_NO_SPIN,
        models=(_printed(0.80, -0.98, 0.11),),
        says="Rebound angle against the angle, Wang et al. (2020); Eqs (32) and (33).",
        uses="(32) in sticking, (33) in sliding; the text names (33) only",
        note="delta hardly fixes e_t: its printed value is rather assumed than found.",
    ),
    PaperFigure(
        "8",
        "Steel ball on granite: contact angles",
        "points",
        "cross-2019-psi-after",
        CONTACT,
        Ordinate("psi_after_deg", -30.0, 90.0, name="contact angle after"),
        _NO_SPIN,
        (_CROSS,),
        says="Contact angle after against before, Cross (2019), no spin; Eqs (36) and (37).",
        uses="(36) in sticking, (37) in sliding, over the incoming normal velocity",
        note="The impacts of Fig. 3.",
    ),
    PaperFigure(
        "9",
        "Steel ball on granite: apparent friction",
        "points",
        "cross-2019-mu-app",
        TANGENT,
        Ordinate("mu_app", 0.0, 0.28),
        _NO_SPIN,
        (
            _CROSS,
            *_E_T_LINES,
            _with_e_t(-1.0, "black", (0, (1, 1.4)), "FR: $e_t$ −1"),
        ),
        says="mu_app against tan gamma, Cross (2019), no spin; Eq. (30) in sticking, (31) in sliding for "
        "four values of e_t; dotted: FR.",
        uses="(31) in sticking, (30) in sliding; FR is e_t = -1, beta0 = 2/5",
        note="The four values of e_t are not printed: ours are -0.99, -0.98, -0.96 and -0.94. The axis is "
        "logarithmic, so that both regimes can be read. The impacts of Fig. 3.",
    ),
    PaperFigure(
        "A2.1a",
        "Lateral deviation, $R\\omega_x/u$ = 0.30",
        "theory",
        x=FROM_NORMAL,
        y=Ordinate("lambda_deg", -95.0, 95.0),
        settings=(Setting("", 0.30),),
        models=(
            _LATERAL,
            replace(
                _LATERAL,
                label="as Eq. (34) is printed, without its minus sign",
                kind="as_printed",
                pen=_MISPRINT,
                misprint=deviation_as_printed,
            ),
        ),
        says="Lateral deviation against the angle for R omega_x/u = 0.30; Eqs (18), (19), (34), (35).",
        uses="(34) with a minus sign, (35)",
        note="Theory alone: the circles of the paper are idealised points, not data, and are left out.",
    ),
    PaperFigure(
        "A2.1b",
        "Lateral deviation at γ = 45°",
        "theory",
        x=LATERAL_SPIN,
        y=Ordinate("lambda_deg", -20.0, 0.0),
        models=(_LATERAL,),
        says="Lateral deviation against R omega_x/u at 45 degrees; Eqs (18), (19), (34), (35).",
        uses="(35): at 45 degrees all impacts slide",
        note="Theory alone, as Fig. A2.1a.",
    ),
)

_OF_KHARAZ = "Alumina on glass, Kharaz et al. (2001)"

KHARAZ = tuple(
    PaperFigure(
        f"kharaz-{name}", _OF_KHARAZ, "kharaz", "kharaz-2001-from-15-deg", y=y, settings=(Setting(""),)
    )
    for name, y in {
        "beta": Ordinate("beta", -1.0, 0.6),
        "psi-after": Ordinate("psi_after_deg", -30.0, 90.0, name="contact angle after"),
        "mu-app": Ordinate("mu_app", 0.0, 0.14),
        "delta": Ordinate("delta_deg", 0.0, 90.0),
    }.items()
)

FIGURES = (*PAPER, *KHARAZ)
