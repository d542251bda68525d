"""`ifrfit import --tracks` and `check --tracks`: a camera's table becomes impacts, or is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ball_tracks import Bounce, table

import ifrfit

GIVEN = ("--tracks", "--pixel", "0.1mm", "--radius", "20mm")


@pytest.fixture
def tracks() -> Path:
    bounces = [Bounce(before=(1.0 + 0.5 * i, -4.0), at=0.01 + 3e-4 * i) for i in range(6)]
    path = Path("tracks.csv")
    text = table(bounces, frames=(9, 9), noise=5e-5, angle_noise=0.02, rng=np.random.default_rng(6))
    path.write_text(text, encoding="utf-8")
    return path


def test_impacts_of_tracks_are_read_and_fitted(cli, tracks):
    said = cli("import", tracks, *GIVEN, "--out", "data.csv")
    assert (said.returncode, said.stderr) == (0, "")
    assert said.stdout.startswith("data.csv: 6 impacts of tracks\n")
    assert "positions are wrong by " in said.stdout
    go_on = "go on with: ifrfit "
    last = said.stdout.splitlines()[-1]
    assert last == f"{go_on}fit data.csv --angle-errors effective"
    assert cli(*last.removeprefix(go_on).split(), "--observable", "v_n").returncode == 0
    found, direct = ifrfit.read("data.csv"), ifrfit.read_tracks(tracks, pixel="0.1mm", radius="20mm")
    columns = ["gamma_deg", "value", "sigma", "sigma_gamma_deg", "speed_m_s", "spin_y"]
    np.testing.assert_allclose(found.table[columns], direct.table[columns], rtol=1e-8)
    assert found.notes == direct.notes
    fitted = cli("fit", "data.csv", "--observable", "v_n")
    assert fitted.returncode == 0, fitted.stderr
    frames = tracks.read_text(encoding="utf-8").replace("t [s]", "t [ms]")
    tracks.write_text(frames, encoding="utf-8")
    assert cli("import", tracks, *GIVEN, "--contact", "0us").returncode == 0


def test_check_says_what_tracks_hold(cli, tracks):
    said = cli("check", tracks, *GIVEN)
    assert (said.returncode, said.stderr) == (0, "")
    text = " ".join(said.stdout.split())
    assert "column 'z [m]' is normal to the wall (m)" in text
    assert "column 'angle [rad]' is the angle of a mark, from x towards z (rad)" in text
    assert "6 v_n of tracks" in text
    assert "e_n, from v_n" in text
    assert "positions are wrong by" in text


@pytest.mark.parametrize(
    ("given", "status", "says"),
    [
        (
            ("import",),
            2,
            "--x: say what the axes of the figure are, as --x gamma_deg --y beta; or, of positions",
        ),
        (("import", "--fps", "1000"), 2, "--fps: is about tracks. Say --tracks, too, or leave it away."),
        (("import", "--tracks", "--x", "gamma_deg"), 2, "--x: is about a figure, not about tracks."),
        (("check", "--tracks", "--y", "beta"), 2, "--y: is about a figure, not about tracks."),
        (("check", "--pixel", "1mm"), 2, "--pixel: is about tracks."),
        (("check", "--tracks"), 2, "--radius: tracks.csv has angles of a mark."),
        (
            ("check",),
            3,
            "tracks.csv: looks like positions frame by frame, run, t [s], x [m] and z [m], not like",
        ),
        (("fit",), 3, "Make these of it: 'ifrfit import tracks.csv --tracks --out impacts.csv'."),
    ],
)
def test_what_does_not_fit_is_refused(cli, tracks, given, status, says):
    command, *rest = given
    said = cli(command, tracks, *rest)
    assert said.returncode == status
    assert says in " ".join(said.stderr.split())
