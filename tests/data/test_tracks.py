"""Tracks of a known bounce: velocities within what is said of their errors, spins, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from ball_tracks import Bounce, table, track
from refusals import refused

import ifrfit
from ifrfit.data.tracks.free_flight import Side, fit_sides
from ifrfit.data.tracks.impact_states import impact_states
from ifrfit.data.tracks.track import Track
from ifrfit.errors import DataError, UsageError

BOUNCE = Bounce()
RADIUS = 0.02
SPEED = 5.0  # of (3, 4) m/s
EXACT = {"v_x": 2.0 / SPEED, "v_n": 3.2 / SPEED, "spin_y_after": -RADIUS * 120.0 / SPEED}
TRUTH = np.array([3.0, 4.0, 2.0, -3.2])  # before and after, z into the floor


@pytest.fixture
def read(tmp_path):
    def read(text, *convention, name="tracks.csv", **given):
        path = tmp_path / name
        path.write_bytes(text if isinstance(text, bytes) else text.encode())
        return ifrfit.read_tracks(path, convention=convention, **given)

    return read


def values(found):
    return dict(zip(found.table.observable, found.table.value, strict=True))


def tracks(count, rng, frames, noise, *, contact=0.0, known=False):
    made = []
    for i in range(count):
        bounce = Bounce(at=0.01 + 1e-3 * rng.uniform(), contact=contact)
        _, t, x, z, angle = track(bounce, frames=frames, noise=noise, angle_noise=0.02, rng=rng)
        sigma = dict.fromkeys("xz", np.full(len(t), noise)) if known else {}
        made.append(Track(str(i), f"run {i}", np.arange(len(t)), t, {"x": x, "z": z}, angle, sigma))
    return made


def test_without_noise_the_bounce_comes_out(read):
    found = read(table([BOUNCE]), radius="20mm", pixel=1e-9)
    assert values(found) == pytest.approx(EXACT, rel=1e-9)
    row = found.table.iloc[0]
    assert row.gamma_deg == pytest.approx(np.degrees(np.arctan2(3, 4)))
    assert row.spin_y == pytest.approx(-RADIUS * 40.0 / SPEED)
    assert row.speed_m_s == pytest.approx(SPEED)
    assert (row.impact_id, row.row, row.series) == ("1", 2, "tracks")


@pytest.mark.parametrize("frames", [(5, 5), (8, 9), (30, 30)])
def test_the_few_frames_share_gravity_and_the_many_have_their_own(read, frames):
    found = read(table([BOUNCE, replace(BOUNCE, at=0.0305)], frames=frames), radius=RADIUS, pixel="1um")
    assert found.table.value.to_numpy() == pytest.approx([*EXACT.values()] * 2, rel=1e-6)
    assert any(
        "share one acceleration, -0 m/s^2 along x, -9.81" in note or "-9.81 m/s^2 along z" in note
        for note in found.notes
    ) == (frames == (5, 5))


@pytest.mark.parametrize(
    "turned",
    [
        pytest.param(lambda t, x, z, a: (t, -x, z, np.pi - a), id="the other way"),
        pytest.param(lambda t, x, z, a: (t, x, -z, -a), id="z down"),
        pytest.param(lambda t, x, z, a: (t, -x, -z, np.pi + a), id="z down, the other way"),
        pytest.param(lambda t, x, z, a: (t, x + 3.0, z - 7.0, a + 1.0), id="another origin"),
    ],
)
def test_frames_of_reference_change_nothing(read, turned):
    _, *track_of = track(BOUNCE)
    rows = zip(*(np.asarray(each).tolist() for each in turned(*track_of)), strict=True)
    text = "t_s,x_m,z_m,angle_rad\n" + "".join(",".join(map(repr, row)) + "\n" for row in rows)
    assert values(read(text, radius=RADIUS, pixel=1e-9)) == pytest.approx(EXACT, rel=1e-7)


def test_units_frames_and_pixels(read):
    number, t, x, z, angle = track(BOUNCE)
    plain = values(read(table([BOUNCE]), radius=RADIUS, pixel=1e-9))
    text = "frame;x (px);z (px);phi [deg]\n"
    text += "".join(
        f"{n};{a / 2e-4!r};{b / 2e-4!r};{c!r}\n"
        for n, a, b, c in zip(
            number.tolist(), x.tolist(), z.tolist(), np.degrees(angle).tolist(), strict=True
        )
    )
    assert values(read(text, fps=1000, pixel="0.2mm", radius="2cm")) == pytest.approx(plain, rel=1e-9)
    text = "t [ms],x [mm],z_cm\n"
    text += "".join(
        f"{1e3 * n!r},{1e3 * a!r},{1e2 * b!r}\n"
        for n, a, b in zip(t.tolist(), x.tolist(), z.tolist(), strict=True)
    )
    found = values(read(text, pixel="1um"))
    assert found == pytest.approx({name: plain[name] for name in ("v_x", "v_n")}, rel=1e-9)


@pytest.mark.parametrize("known", [True, False])
@pytest.mark.parametrize(("frames", "contact"), [((6, 9), 0.0), ((6, 9), 0.0015), ((10, 10), 0.0015)])
def test_velocities_lie_within_their_covariance(frames, contact, known):
    """chi2 of 4 velocities of 160 impacts: 4 +- sqrt(8/160) = 0.22; the bound is four of these."""
    chi2, turns = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        for state in impact_states(tracks(20, rng, frames, 1e-4, contact=contact, known=known)).states:
            off = np.array([state.before["x"], state.before["z"], state.after["x"], state.after["z"]]) - TRUTH
            chi2.append(off @ np.linalg.solve(state.covariance, off))
            turns += [(state.spin_before[0] + 40.0) / state.spin_before[1]]
            turns += [(state.spin_after[0] + 120.0) / state.spin_after[1]]
    assert np.mean(chi2) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / len(chi2)) + 0.1)
    assert np.mean(np.square(turns)) == pytest.approx(1.0, abs=4.0 * np.sqrt(2.0 / len(turns)))


def test_a_long_contact_is_left_out_where_it_is_given():
    """The control: without its duration frames of it that lie off unseen make chi2 too large."""

    def mean_chi2(contact):
        found = []
        for seed in range(6):
            made = tracks(20, np.random.default_rng(seed), (10, 10), 1e-4, contact=0.0045, known=True)
            for state in impact_states(made, contact=contact).states:
                off = (
                    np.array([state.before["x"], state.before["z"], state.after["x"], state.after["z"]])
                    - TRUTH
                )
                found.append(off @ np.linalg.solve(state.covariance, off))
        return np.mean(found)

    assert mean_chi2(0.0052) == pytest.approx(4.0, abs=4.0 * np.sqrt(8.0 / 120.0))
    assert mean_chi2(None) > 6.0


def test_the_shared_acceleration_is_exact_least_squares():
    """Against one design matrix with all unknowns of all sides."""
    rng = np.random.default_rng(1)
    sides = []
    for n in (4, 5, 6):
        t = np.sort(rng.uniform(0.001, 0.01, n)) * rng.choice([-1.0, 1.0])
        sides.append(
            Side(t, 1.0 + 3.0 * t - 5.0 * t**2 + 1e-4 * rng.standard_normal(n), rng.uniform(1e-4, 3e-4, n))
        )
    size = sum(len(side.time) for side in sides)
    design, value, row = np.zeros((size, 7)), np.zeros(size), 0
    for i, side in enumerate(sides):
        rows = slice(row, row + len(side.time))
        columns = np.column_stack([np.ones_like(side.time), side.time, 0.5 * side.time**2])
        design[rows, [2 * i, 2 * i + 1, 6]] = 0.0
        design[rows, 2 * i : 2 * i + 2], design[rows, 6] = columns[:, :2], columns[:, 2]
        design[rows] /= side.sigma[:, None]
        value[rows] = side.value / side.sigma
        row += len(side.time)
    inverse = np.linalg.inv(design.T @ design)
    whole = inverse @ design.T @ value
    found = fit_sides(sides)
    np.testing.assert_allclose(found.velocity, whole[[1, 3, 5]], rtol=1e-7)
    np.testing.assert_allclose(found.acceleration, whole[6], rtol=1e-6)
    np.testing.assert_allclose(found.covariance, inverse[np.ix_([1, 3, 5], [1, 3, 5])], rtol=1e-6)
    assert found.dof == size - 7
    left = value - design @ whole
    assert found.scatter == pytest.approx(np.sqrt(left @ left / found.dof), rel=1e-6)


def test_a_given_acceleration_makes_errors_smaller(read):
    text = table([BOUNCE], frames=(6, 6), noise=1e-4, rng=np.random.default_rng(2))
    free, floor = (
        read(text, radius=RADIUS, pixel="0.3mm"),
        read(text, radius=RADIUS, pixel="0.3mm", acceleration=9.81),
    )
    assert (floor.table.sigma[:2] < 0.7 * free.table.sigma[:2]).all()
    pull = (floor.table.value[:2] - [EXACT["v_x"], EXACT["v_n"]]) / floor.table.sigma[:2]
    assert (np.abs(pull) < 4.0).all()


def test_the_file_may_give_errors_and_series(read):
    text = "series,run,t_s,x_m,z_m,sigma_x_mm,sigma_z_mm\n"
    for run, name in enumerate(("glass", "steel")):
        _, t, x, z, _ = track(BOUNCE, frames=(9, 9))
        text += "".join(
            f"{name},{run},{a!r},{b!r},{c!r},0.1,0.2\n"
            for a, b, c in zip(t.tolist(), x.tolist(), z.tolist(), strict=True)
        )
    found = read(text)
    assert list(dict.fromkeys(found.table.series)) == ["glass", "steel"]
    assert any("wrong by 0.1 mm in x, 0.2 mm in z, as the file gives them" in note for note in found.notes)
    twice = read(text.replace(",0.1,0.2\n", ",0.2,0.4\n"))
    np.testing.assert_allclose(twice.table.sigma, 2.0 * found.table.sigma)


def test_notes_say_what_pixel_and_frame_rate_do(read):
    notes = " ".join(read(table([BOUNCE] * 3), radius=RADIUS, pixel="0.1mm").notes)
    assert "positions are wrong by 0.029 mm in x, 0.029 mm in z" in notes  # 0.1 mm/sqrt(12)
    assert (
        "pixels half as large halve that, twice the frame rate over the same path divides it by 1.4" in notes
    )
    assert "less than half a turn from frame to frame; faster spins would look like slower ones" in notes
    one = read(table([replace(BOUNCE, contact=0.006)], frames=(12, 12)), radius=RADIUS, pixel="0.1mm")
    assert any(
        "the contact lasts longer than two frames. Say how long, as --contact" in note for note in one.notes
    )


def test_an_impact_is_told_from_the_top_of_a_flight(read):
    """A ball thrown up, which turns at the top of its flight before it hits the floor."""
    fps, rng = 200.0, np.random.default_rng(4)
    t = np.arange(120) / fps
    z = 2.0 * t - 0.5 * 9.81 * t**2 + 1e-4 * rng.standard_normal(120)
    hit = 2 * 2.0 / 9.81
    down = t > hit
    z[down] = 1.6 * (t[down] - hit) - 0.5 * 9.81 * (t[down] - hit) ** 2
    text = "t_s,x_m,z_m\n" + "".join(
        f"{a!r},{1.5 * a!r},{b!r}\n" for a, b in zip(t.tolist(), z.tolist(), strict=True)
    )
    found = read(text, pixel="0.1mm")
    u = np.hypot(1.5, 2.0)
    assert values(found) == pytest.approx({"v_x": 1.5 / u, "v_n": 1.6 / u}, abs=5e-3)


def lines_of(text, keep):
    head, *rows = text.splitlines()
    return "\n".join([head, *rows[keep]]) + "\n"


def spun(rate, *, noise=0.0, frames=(8, 8)):
    return table([replace(BOUNCE, spin=(0.0, rate))], angle_noise=noise, frames=frames)


BROKEN = [
    (
        lines_of(table([BOUNCE]), slice(6, None)),
        {},
        "run 1: z turns round near .* with fewer than 3 frames before",
    ),
    (
        lines_of(table([BOUNCE]), slice(0, 5)),
        {},
        "run 1: has 5 frames; 3 before the impact and 3 after it are",
    ),
    (
        lines_of(table([BOUNCE]), slice(0, 8)),
        {},
        "run 1: shows no impact: z, the coordinate normal to the wall",
    ),
    (
        lines_of(table([BOUNCE]), slice(5, None)),
        {},
        "run 1: has 2 frames before the impact near .* beside the nearest, which may be of the contact",
    ),
    (
        lines_of(table([BOUNCE]), slice(4, None)),
        {"contact": "4ms"},
        "has 2 frames before the impact near .* out of",
    ),
    (
        "run,t_s,x_m,z_m\n"
        + "".join(f"a,{i * 1e-3!r},{i * 1e-3!r},{abs((i % 20) - 9.5) * 2e-3!r}\n" for i in range(60)),
        {},
        "run a: hits 5 times, near 0.0095 s .line .*. and 0.0195 s .line .*. A run is one impact: give "
        "each a number of its own in the column run",
    ),
    (
        table([BOUNCE]).replace("\n1,0.005,", "\n1,0.019,"),
        {},
        "run 1, line 3: t = 0.006 s does not come after t = 0.019 s of line 2",
    ),
    (
        table([BOUNCE, BOUNCE]).replace("\n2,", "\n1,"),
        {},
        "run 1, line 18: t = 0.005 s does not come after t = 0.02 s",
    ),
    (
        table([BOUNCE], header="run,t,x [m],z [m],angle [rad]"),
        {},
        "column t: no unit. Put one into the header, as time",
    ),
    (
        table([BOUNCE], header="run,t [s],x,z [m],angle [rad]"),
        {},
        "column x: no unit. Put one into the header, as x",
    ),
    (
        table([BOUNCE], header="run,t [s],x [s],z [m],angle [rad]"),
        {},
        "column x .s.: the unit 's' does not fit here",
    ),
    (table([BOUNCE], header="run,t [s],x [m],y [m],angle [rad]"), {}, "no column z, .* Call the column y so"),
    (
        table([BOUNCE], header="run,speed,x [m],z [m],angle [rad]"),
        {},
        "has no use for speed. Known are t or frame",
    ),
    (table([BOUNCE], header="run,run,x [m],z [m],angle [rad]"), {}, "columns 1 and 2 are both called 'run'"),
    (
        table([BOUNCE], header="run,series,x [m],z [m],angle [rad]"),
        {},
        "there is no time. Add a column t .s., or frame",
    ),
    (table([BOUNCE], header="run,t [s],x [m],z [m],sigma_x [m]"), {}, "gives the error of x, but not of z"),
    (
        spun(0.85 * np.pi * 1000),
        {"radius": 0.02},
        "run 1, after the impact: the mark turns by 153 degrees from frame",
    ),
    (table([BOUNCE]).replace("0.0", "zero", 1), {}, "is not a number"),
]


@pytest.mark.parametrize(("text", "given", "says"), BROKEN)
def test_what_is_broken_is_refused_in_a_sentence(read, text, given, says):
    with refused(DataError, says):
        read(text, **{"pixel": "0.1mm", "radius": "20mm"} | given)


@pytest.mark.parametrize(
    ("text", "given", "says"),
    [
        (
            table([BOUNCE]),
            {"fps": 100.0, "radius": 0.02},
            "--fps: .* gives times, in the column t .s.. Leave it away.",
        ),
        (
            table([BOUNCE], header="run,frame,x [m],z [m],angle [rad]"),
            {},
            "--fps: .* numbers frames. Say how many",
        ),
        (
            table([BOUNCE], header="run,frame,x [m],z [m],angle [rad]"),
            {"fps": -1.0},
            "--fps -1: the frames in a second must be a positive number",
        ),
        (
            table([BOUNCE], header="run,t [s],x [px],z [px],angle [rad]"),
            {},
            "--pixel: .* positions in pixels",
        ),
        (table([BOUNCE]), {}, "--radius: .* has angles of a mark. Say how large the ball is"),
        (
            table([BOUNCE]),
            {"radius": "20"},
            "--radius 20: write a positive length with its unit, as --radius 0.1mm",
        ),
        (table([BOUNCE]), {"pixel": "-1mm"}, "--pixel -1mm: write a positive length"),
        (table([BOUNCE]), {"contact": "3mm"}, "--contact 3mm: write a positive time"),
        (table([BOUNCE]), {"frames": 2}, "--frames 2: 3 on a side are the fewest"),
    ],
)
def test_options_that_do_not_fit_are_refused(read, text, given, says):
    with refused(UsageError, says):
        read(text, **given)


def test_walls_on_two_sides_are_refused(read):
    _, t, x, z, _ = track(BOUNCE)
    rows = [("1", *row) for row in zip(t, x, z, strict=True)] + [
        ("2", *row) for row in zip(t, x, -z, strict=True)
    ]
    text = "run,t_s,x_m,z_m\n" + "".join(",".join(map(str, row)) + "\n" for row in rows)
    with refused(DataError, "run 2: meets the wall at its largest z, 1 at the other end"):
        read(text)


def test_slow_marks_are_unwrapped_and_gaps_in_them_do_no_harm(read):
    for rate in (-900.0, 30.0, 0.75 * np.pi * 1000):
        found = read(spun(rate, noise=0.01), radius=RADIUS, pixel="0.1mm")
        spin = found.table[found.table.observable == "spin_y_after"].iloc[0]
        assert abs(spin.value - RADIUS * rate / SPEED) < 5.0 * spin.sigma
        assert spin.sigma < 0.01 * max(abs(spin.value), 1.0)
    head, *rows = spun(300.0).splitlines()
    rows[11] = rows[11].rpartition(",")[0] + ","
    found = read("\n".join([head, *rows]) + "\n", radius=RADIUS, pixel="0.1mm")
    assert values(found)["spin_y_after"] == pytest.approx(RADIUS * 300.0 / SPEED, rel=1e-3)


def test_whatever_is_damaged_is_read_or_refused_in_a_sentence(read):
    """Cut anywhere, with cells of another kind, or with lines in another order."""
    whole = table([BOUNCE, replace(BOUNCE, at=0.03)], noise=1e-4, rng=np.random.default_rng(7))
    rng = np.random.default_rng(8)
    head, *rows = whole.splitlines()
    texts = [whole[:cut] for cut in range(0, len(whole), 41)]
    for _ in range(40):
        cells = [row.split(",") for row in rows]
        cells[rng.integers(len(cells))][rng.integers(5)] = str(
            rng.choice(["", "x", "nan", "inf", "1e300", "-1", "0", "1e-300"])
        )
        texts.append("\n".join([head, *(",".join(row) for row in cells)]) + "\n")
    for _ in range(10):
        texts.append("\n".join([head, *rng.permutation(rows).tolist()]) + "\n")
    outcomes = set()
    for text in texts:
        said = ""
        try:
            assert np.isfinite(read(text, radius=RADIUS, pixel="0.1mm").table["value"]).all()
        except (DataError, UsageError) as error:
            said = str(error)
        assert "\n" not in said
        outcomes.add(bool(said))
    assert outcomes == {True, False}
