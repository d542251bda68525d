"""The rules behind statuses and facts: one table, which the documentation repeats word for word."""

from __future__ import annotations

RANK = 1e-6
HALF = 0.5
GAP = 1e-9
NOISE_GAP = 0.05
RIVAL = 0.01
ALIKE = 4.0
REFUTED = 0.001  # of each fact, so that all together stay near or below 0.01 a fit on clean data
DECISIVE = 18.4
TELLING = 13.8  # fall of -2 log likelihood: a ratio of likelihoods of 1,000
AT_REST = 1e-6
FAILED = 0.01
RHAT = 1.01
ESS = 2000
LENGTH = 50
STABLE = 0.2
PULL = 3.0
FEW_DOF = 1.5
COARSE = 0.6
TOO_NARROW = 1.5
TIMES_FITTED = 4.0
TIMES_GIVEN = 0.3
MOST_MISSING = 5.0
MOVES = 0.25  # sd of a constant by which readings that end at 0 move it, from which they are told
RANGE_OF_SPEEDS = 1.2  # of the largest over the smallest, from which something is asked of them
TINY_FRICTION = 0.005  # mu of no dry contact
FRICTION_OF_NO_CONTACT = 10.0  # nor is that
ROUGH_SIGMA = 0.4  # scatter of logarithms of sigmas, as of five readings each
FEWEST_BENDS = 6  # of sigmas, from which that is looked at
FEWEST_ALIKE = 5
BESIDE = 0.01  # p of a finding without the row or pair that speaks most
BY_CHANCE = 0.001
BY_RANK = 0.2

STATUSES = {
    "determined": "sd below half the sd of the default prior, and none of the rows below",
    "one_sided": "the optimum lies on a bound, or the 95 % interval does not close on one side within the "
    "domain: the interval runs from the bound to its 95 % quantile",
    "prior": "your own prior narrows it: sd with the prior below half of the sd without (a prior as wide as "
    "half of its constant's domain counts for nothing where the data do not see it); or the data leave it "
    "open, and your own bounds confine it: sd below half of that over the passive domain",
    "not_determined": "otherwise; no value, the compatible interval kept, the reason in words",
    "fixed": "by you",
}

# Importance sampling: standard error in sd, effective draws, share of the weight that one draw may have
SAMPLING_ERROR, LEAST_EFFECTIVE, LARGEST_WEIGHT = 0.05, 1000.0, 0.02
FAR_BELOW = 50.0  # of the log density from the known modes to draws that have missed them

FACTS = {
    "converged": f"last relative change of the noise <= {AT_REST:g} (none where sigma is known); profile: "
    "besides, every profile closes or reaches the end of its domain, and the noise settles there "
    "(last fall of the objective <= 1e-4, relative where the rise is over 1); exact: last change of every "
    "mean, sd and quantile <= 1e-4 of a standard deviation, of the log evidence <= 1e-4 (or as small as "
    f"asked); mcmc: for every constant, kappa and noise, R-hat over the ensembles < {RHAT:g} "
    f"(rank-normalised, split), >= {ESS:,} effective draws in the bulk and in the tails, and >= {LENGTH} "
    f"autocorrelation times kept, which change by <= {100 * STABLE:g} % to the later half; bootstrap: "
    f"besides the noise, <= {100 * FAILED:g} % of the replicates without an answer",
    "global_optimum": f"gap between chi2 and a proven lower bound over everything else <= {GAP:g} relative, "
    "and no second optimum within 1e-6; those within 4 are counted. With several unknown noises, or "
    "a prior beside one, the gap is that of minus twice the log likelihood with each noise at its best, "
    f"<= {NOISE_GAP:g}",
    "noise_modes": "stands only where it fails: modes of the likelihood that lie 3 sd apart in a constant, "
    f"each with a weight (height times volume of the Gaussian about it) of {100 * RIVAL:g} % or more",
    "noise_dof": f"stands only where it fails: an unknown noise keeps fewer than {FEW_DOF:g} degrees of "
    "freedom, its rows less what the constants take of them",
    "identifiable": f"rank of the scaled Jacobian (singular values over {RANK:g} of the largest, each free "
    "combination's sd below half its prior sd) equals the number of free constants, and each has a value",
    "tiny_friction": f"stands only where it fails: the 95 % interval of a mu ends below {TINY_FRICTION:g}, "
    "and the readings are not simulated",
    "at_bound": "no determined constant lies on its bound or has it in its 95 % interval",
    "repeats": "stands only where it fails, in the place of lack of fit: settings differ by more than their "
    f"repeats (F, p < {REFUTED:g}, times the number of tests), while a smooth departure of the means has "
    "p >= 0.01 beside their own scatter, or all settings but one agree (p >= 0.05)",
    "left_out_readings": "stands only where it fails: of readings that are left out, as their impacts count "
    f"already, those used make another value (Student's t, p < {REFUTED:g}, times the number of tests), by "
    "2 % of its size or more",
    "unrelated_readings": "stands only where it fails: of the readings of an observable that knows the angle "
    f"neither the law nor a smooth curve over the angle explains anything (F, p >= {BY_CHANCE:g} against the "
    f"mean of each series), while the law's own values in the order of the readings' sizes leave less than "
    f"{BY_RANK:g} of their scatter, and the law at the constants that the other observables tell, if "
    f"they do, would show beside such a scatter (F, p < {BY_CHANCE**2:g}); looked for where no slip is found",
    "lack_of_fit": f"p >= {REFUTED:g}: of chi2 where sigma is known; else of F tests against repeats, of "
    "each observable and of all, p times their number; else of a smooth departure in tau (natural cubic "
    "spline, 3 degrees of freedom) and of the runs test, or of tosses of a coin where all residuals of an "
    "observable are of one sign",
    "beyond_closure": f"stands only where it fails: p < {REFUTED:g}, times the number of rows, that a "
    "reading lies within what the closure gives between the ends of its domain, and a quarter of the rows of "
    "its observable beyond it at 0.025; an unknown noise is that of the differences of neighbours along tau, "
    "where that is smaller",
    "normal_restitution": f"p >= {REFUTED:g}, times the number of looks: readings of e_n as a parabola "
    "in the angle and in the logarithm of the speed against one value; their mean against a fixed value or a "
    "prior, and against 1; no single reading 4 sd above 1",
    "prior_conflict": f"stands where p < {REFUTED:g}, times the number of constants that were fixed, have "
    "a prior or lie on a bound of yours: the constant without that describes the data better (F, or chi2 for "
    "known sigma)",
    "friction_beyond_prior": "stands only where it fails: the best mu lies beyond the end of its default "
    f"prior, and describes the data better than any within (p < {REFUTED:g}, chi2 of the fall in -2 log L; "
    "of posteriors with plain errors)",
    "pooling": f"with several series: p >= {REFUTED:g}, times the number of constants, that one of each "
    "describes all series as well as one each (F, or chi2 for known sigma)",
    "unequal_noise": f"stands only where it fails: p < {REFUTED:g}, times the number of noises, of "
    "Bartlett's test over the series that share an unknown noise",
    "mixture": "stands only where it fails: two kinds of impacts that differ in one constant take "
    f"{TELLING:g} off -2 log likelihood, times the share of rows that the constants leave where a noise is "
    f"unknown, without the impact that speaks most, and {ALIKE:g} more than a constant that scatters "
    "normally and than errors of one hump, skewed or with tails; or, unless the table is in the order of "
    "angle, speed or values, a run of impacts along it has a value of its own of one constant (chi2 of the "
    f"fall, p < {REFUTED:g}, times twice the number of runs and constants; without the impact that speaks "
    f"most p < {BESIDE:g}); looked for where nothing else is found",
    "independence": f"stands only where it fails: p < {REFUTED:g}, times the number of observables and "
    "orders, that neighbouring residuals of a series are so alike (von Neumann's ratio, at any number of "
    "constants), along the table (unless it was sorted by the values of an observable) and along the angle; "
    "where angles are repeated often, of the scatter about their means; else only where nothing before it "
    "explains the residuals",
    "growing_scatter": f"stands only where it fails: p < {REFUTED:g}, times the number of observables, of "
    "the score test that the variance of an unknown noise goes with a power of one over the observable's "
    "denominator, also without the row that speaks most; a rank correlation at 0.01, and a fall of -2 log "
    f"likelihood of {ALIKE:g} where it is in proportion; outliers are those under a noise that grows so",
    "scatter_by_angle": f"stands only where it fails: p < {REFUTED:g}, times the number of observables, of "
    "the likelihood ratio that the logarithm of the variance is a parabola of the angle of incidence; a rank "
    f"correlation at 0.01, and a fall of -2 log likelihood of {ALIKE:g} beyond the two numbers more, without "
    "the row that speaks most, that single outliers do not reach and errors of velocities miss by "
    f"{ALIKE:g}; looked for where nothing else is found; outliers are those under such a noise",
    "angle_scatter": f"stands only where it fails: p < {REFUTED:g} of an error of one degree in the angle of "
    "each impact against none (a likelihood ratio; without the impact that speaks most p < 0.01), or, where "
    f"all angles are multiples of 10, 5, 2 or 1 degrees, a fall of -2 log likelihood of {DECISIVE:g} with "
    "angles rounded to these; with errors of the size of largest likelihood no lack of fit (p >= 0.01), "
    "slip, effect or other series is left; a sigma that is too small, errors of velocities or in proportion "
    "to the value, outliers, "
    f"impacts of two kinds, slips and effects take no {ALIKE:g} more off -2 log likelihood, and are named "
    f"beside it where they take no {ALIKE:g} less; errors of one size that sigma does not have take "
    f"{ALIKE:g} less",
    "scatter_too_large": (
        f"stands only where it fails: p < {REFUTED:g} of chi2, for known sigma, of all rows or of one "
        "observable (times their number), where no slip or effect leaves p >= 0.01 and explains more than "
        "errors of one size; and with the noise taken from the scatter there is no lack of fit (p >= 0.05), "
        "no outlier but under a noise that changes with the angle, no slip, effect or series that differs; "
        f"errors of one size are called for where they take {ALIKE:g} more off -2 log likelihood than a "
        "factor on sigma, without the row that speaks most; not where a few outliers are all that chi2 "
        "refutes (p >= 0.01 without them)"
    ),
    "sigma_of_few": "stands only where it fails: the logarithms of sigmas that are used as given, by the "
    f"angle in each observable of each series, bend by {ROUGH_SIGMA:g} or more (median of {FEWEST_BENDS} "
    "second differences or more, as standard deviation), as those of five readings or fewer do; less what "
    "the speed and the slip, cosine, sine or value of each row explain, where that is half the mean square",
    "scatter_too_small": f"stands only where it fails: p < {REFUTED:g} of chi2 from below, for known sigma, "
    "of all rows, of one observable, or of some of several series where the rest scatters twice as much "
    "(times their number); in percent where a hundredth of it leaves "
    "p >= 0.01",
    "effects": f"p >= {REFUTED:g} in score tests, corrected for their number (Holm), also without the row "
    "that speaks most for the effect: of the directions in which tangential compliance, e_n(v) by "
    "viscoelasticity or yield, adhesion and rolling friction would move the values, and of other laws of "
    "sticking, sliding, friction and restitution, of a constant of sticking that changes with the angle and "
    "of another inertia factor, which may be mistaken for them; named is the largest fall of -2 log "
    "likelihood, with those within 4 of it",
    "slips": f"p >= {REFUTED:g} in score tests, corrected for their number (Holm), also without the row that "
    "speaks most: of an offset of the angles, a turned camera, the scale of angles, of speeds, those of "
    "the contact point too, of lengths along the wall, of spins and of values whose largest is exactly 1, "
    "velocities as they were above the wall, spin before that is not in the table, another inertia factor, "
    f"a constant that drifts along the table; and a fall of -2 log likelihood below {DECISIVE:g} for the "
    "table with another sign, with angles from the wall, in radians or in gon, percent, squares, sizes "
    "without sign, values sorted by themselves or shifted by a line, exchanged columns, spins in other "
    "units, centre for contact point, total restitution for the normal one, 0 or one repeated number for "
    "'not measured'; in the table and in each of its series, p "
    "times their number; for signs, angles, percent, squares and spins of the other sign in some rows, too, "
    "beyond 2 log 2 for each choice; p of chi2 of 2 for a share of turned signs where readings of v_n, e_n "
    "or mu lie below 0, the fall of the readings mirrored at the law taken off. It "
    f"fails only where no effect explains more by {ALIKE:g}, and constants of each series explain "
    f"{ALIKE:g} less, and angles have room for their offset; drifts are looked for unless the table was "
    "sorted by angle, speed or the values of an observable; what explains as much is named beside it. "
    "Where it leaves a smooth departure, a further slip with a size or a prior that is missed "
    f"(p < {REFUTED:g}, three times) it is said to explain a part",
    "duplicates": f"stands only where it fails: p < {REFUTED:g} that so many impacts of one setting, in one "
    "series or in two, agree in every decimal, by noise and rounding (Poisson); or, where no misfit and no "
    "slip is found, changes of the residuals, in one unit, of two observables of one velocity from one angle "
    f"to the next correlate by more than 0.95, or of v_x and the spin by more than 0.999 (p < {REFUTED:g}, "
    "times twice the number of pairs)",
    "second_readings": "stands only where it fails: residuals of two series or files, paired by incidence, "
    f"go together (p < {REFUTED:g}, times the number of tests, of Student's t for each observable and of "
    "their normal scores together) beside the constants of each, a natural spline in tau and the mean of "
    f"four neighbours, or the mean of each angle; without the pair that speaks most p < {BESIDE:g}",
    "rounded_readings": "stands only where it fails: readings that the law has at one value scatter by less "
    f"than {COARSE:g} of the steps in which they are written, and by the counts in these steps the error of "
    f"that value is {TOO_NARROW:g} times that by the scatter",
    "censoring": f"stands only where it fails: p < {REFUTED:g}, times the number of ends of observables, "
    "that so many readings, as fitted or in m/s, are equal to the largest or smallest one, by rounding and "
    "noise (Poisson); or, where a tenth of the impacts have the largest speed before, that readings scatter "
    "so much more in them (F, times three and the number of observables)",
    "truncation": "stands only where it fails: the law with errors that are cut off at the outermost reading "
    f"of an observable takes so much off -2 log likelihood that exp(-fall/2), times {TIMES_FITTED:g} and the "
    f"number of ends of observables, is below {REFUTED:g}, the noise taken from its own rows; of e_n also "
    f"where errors cut off at 1 make {TIMES_GIVEN:g} times exp(-fall/2) so small; the law runs through the "
    f"readings beside the end, and of none more than {MOST_MISSING:g} times as many are missing "
    "as are there (errors are skewed then); looked for where nothing else is found. Errors of v_n, e_n or mu "
    "that are cut off at 0 are looked for beside whatever is found, and stand where "
    f"{TIMES_GIVEN:g} times exp(-fall/2), times the number of these observables, is as small, a constant "
    f"moves by {MOVES:g} sd, they take {ALIKE:g} more than a noise that grows with the law and no slip or "
    f"effect takes {ALIKE:g} more than they do, and normal scores of the readings follow no cubic of the "
    "angle or the speed and no series, in mean or square, and are normal (Jarque-Bera; the least p, times "
    f"their number, over {BESIDE:g}). Of data that are not held in memory also where values were left out "
    "less than 1 below the least one that can be, whose sum of slope/sigma is a tenth of the root of the sum "
    "of slope^2/sigma^2 of those used, or more",
    "repeated_number": f"stands only where it fails: {FEWEST_ALIKE} readings of e_n or v_n of a series or "
    "more, not simulated, all the same in every decimal; or three readings or more of any observable, twice "
    f"as many as of any other number, are the mean of all others (p < {REFUTED:g} by rounding and noise, "
    "Poisson, three times the number of looks); or angle, values and speed of the last line of a table or "
    f"series are the means of those above it, to their last decimal (p < {REFUTED:g} by chance)",
    "outliers": "studentised residuals, or those from the fit without the row, within the Bonferroni limit "
    f"at {100 * REFUTED:g} %, one by one; by "
    "Student's t with the degrees of freedom of the row's own noise where that is unknown",
    "predictive": f"p >= {REFUTED:g} in each of four posterior predictive checks: chi2, runs of signs along "
    "tau, largest residual, share of the rows inside their 95 % band",
    "angle_offset": f"stands where --angle-offset is given: the fitted offset lies within {PULL:g} sd of its "
    "prior, and not where an impact would cross the wall or its normal",
    "resampling": "bootstrap: at least 5 impacts of each kind and series (cases), 5 residuals of each noise "
    "(residual), or no row without a residual (wild): of 5 the sd comes out 10 % too small, of fewer more so",
    "sharing": "constants shared by all series are not refuted: evidence of separate ones less than 20 times "
    "that of shared ones (below a factor 3 there is no preference); the factor depends on the priors' widths",
    "angular_momentum": "velocities and spins close within 5 %, or within 30 % where less than 2.5 % goes "
    "with the change of spin or is the same in all impacts (F, p < 0.001); raw velocities with spin after",
}

# of the fact "converged" where the exact posterior is left to importance sampling
SAMPLED = (
    f"importance sampling: standard error of every mean, sd and quantile <= {SAMPLING_ERROR:g} of a standard "
    "deviation (of a quantile in a gap: that of the probability below it, in the units of a normal law), "
    f"of the log evidence <= {SAMPLING_ERROR:g}; >= {LEAST_EFFECTIVE:,.0f} effective draws, none "
    f"with more than {100 * LARGEST_WEIGHT:g} % of the weight, and the heaviest at most {FAR_BELOW:g} "
    "below the log density at the known modes"
)
