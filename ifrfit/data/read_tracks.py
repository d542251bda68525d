"""Tracks of balls, frame by frame, in the common schema: what moves before and after each impact."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from ifrfit.data.cell_table import CellColumn, Cells
from ifrfit.data.conventions import parse_conventions
from ifrfit.data.observations import Observations
from ifrfit.data.readers import observe
from ifrfit.data.tracks.impact_states import MOST_FRAMES, ImpactState, TrackFits, impact_states
from ifrfit.data.tracks.track import AXES
from ifrfit.data.tracks.track_table import quantity, read_track_table
from ifrfit.errors import DataError, UsageError

_FEW_DOF = 10  # degrees of freedom, below which a scatter is hardly known
_MORE = 1.5  # scatter over the errors that a file gives, from which these are too small


def read_tracks(
    file: str | Path,
    *,
    fps: float | None = None,
    pixel: float | str | None = None,
    radius: float | str | None = None,
    contact: float | str | None = None,
    frames: int = MOST_FRAMES,
    acceleration: float | None = None,
    convention: Sequence[str] | Mapping[str, str] = (),
    inertia_factor: float = 0.4,
) -> Observations:
    r"""Read tracks: a line for each frame, with time, position, and perhaps the angle of a mark on the ball.

    Each run holds one impact, which is found where the normal velocity turns round at once. Velocities are
    those of the free flights next to it: parabolas where a side has seven frames or more, else straight
    lines beside an acceleration that all of these have in common. Frames of the contact are left out. The
    errors of positions are their scatter about these paths, unless the file gives them as ``sigma_x`` and
    ``sigma_z``.

    Parameters
    ----------
    file : str or Path
        A text table or a spreadsheet with ``t`` (or ``frame``), ``x`` along the wall and ``z`` normal to it,
        either way; perhaps ``y``, ``run``, ``angle`` (of a mark, from x towards z), ``series``; units in the
        headers, ``px`` among them.
    fps : float, optional
        Frames in a second, where frames are numbered.
    pixel : float or str, optional
        Size of a pixel in the plane of the motion, m or as ``"0.1mm"``: the unit of positions in pixels, and
        the least error of a position, by its rounding.
    radius : float or str, optional
        Of the ball, m or as ``"20mm"``: makes rates of turning spins.
    contact : float or str, optional
        How long a contact lasts, s or as ``"0.5ms"``; else the nearest frame on either side, and those that
        lie off the free flights, are taken as of it.
    frames : int
        At most so many on a side of an impact.
    acceleration : float, optional
        Into the wall, m/s^2, with none along it: 9.81 for a floor.
    convention : sequence of ``NAME=CHOICE`` or mapping
        ``ignore``, ``sheet`` and ``provenance``; see `ifrfit.read`.
    inertia_factor : float
        As in `ifrfit.read`.

    Returns
    -------
    Observations
        v_x and v_n of each impact, and spin_y_after where marks were seen.

    Raises
    ------
    DataError
        A run has too few frames, no impact or several, or marks that turn too fast; the message names file
        and run.
    UsageError
        An option does not fit the file.

    Examples
    --------
    >>> import ifrfit
    >>> import pathlib, tempfile
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "tracks.csv"
    >>> frames = [(t, 3 * t if t < 0 else 2 * t, -4 * t if t < 0 else 3.2 * t) for t in range(-8, 9)]
    >>> lines = [f"{t + 20},{x},{z}" for t, x, z in frames]
    >>> _ = file.write_text("\n".join(["t [ms],x [mm],z [mm]", *lines]))
    >>> ifrfit.read_tracks(file, pixel="0.1mm")
    Observations(tracks.csv: 2 rows of v_x, v_n; provenance not stated)
    """
    conventions = parse_conventions(convention)
    size, ball, lasts = (
        quantity(option, given, dimension)
        for option, given, dimension in (
            ("--pixel", pixel, "length"),
            ("--radius", radius, "length"),
            ("--contact", contact, "time"),
        )
    )
    if frames < 3:
        raise UsageError(f"--frames {frames}: 3 on a side are the fewest that show a velocity and its error.")
    if acceleration is not None and not math.isfinite(acceleration):
        raise UsageError(f"--acceleration {acceleration:g}: it must be a finite number of m/s^2.")
    tracks, cells = read_track_table(Path(file), conventions=conventions, fps=fps, pixel=size)
    fits = impact_states(tracks, pixel=size, contact=lasts, frames=frames, acceleration=acceleration)
    if fits.dof <= 0 and not fits.from_file and size is None:
        raise DataError(
            f"{file}: the frames are too few to show their own scatter, and nothing else says how wrong a "
            f"position is. "
            "Give --pixel, or columns sigma_x and sigma_z."
        )
    made = _cells(fits, cells, ball, conventions.provenance)

    return observe(made, parse_conventions(()), inertia_factor)


def _cells(fits: TrackFits, table: Cells, radius: float | None, provenance: str) -> Cells:
    """The impacts as a table of velocities."""
    states = fits.states
    axes = states[0].track.axes
    columns: dict[str, CellColumn] = {
        "impact_id": [each.track.name or f"line {each.track.lines[0]}" for each in states]
    }
    if any(each.track.series for each in states):
        columns["series"] = [each.track.series for each in states]
    for letter, when in (("u", 0), ("v", 1)):
        for j, axis in enumerate(axes):
            columns[f"{letter}_{axis}_m_s"] = np.array(
                [(each.before, each.after)[when][axis] for each in states]
            )
            at = when * len(axes) + j
            columns[f"sigma_{letter}_{axis}_m_s"] = np.array(
                [math.sqrt(each.covariance[at, at]) for each in states]
            )
    columns |= _spin_columns(states, table, radius)
    if provenance:
        columns["provenance"] = [provenance] * len(states)
    lines = np.array([each.track.lines[0] for each in states], dtype=np.int64)
    notes = (*table.notes, *_notes(fits, table, spins="omega_y_after_rad_s" in columns))
    return Cells(
        table.file,
        table.sha256,
        list(columns),
        0,
        lines,
        list(columns.values()),
        word=table.word,
        notes=notes,
    )


def _spin_columns(states: Sequence[ImpactState], table: Cells, radius: float | None) -> dict[str, CellColumn]:
    columns: dict[str, CellColumn] = {}
    for name, spins in (
        ("omega_y", [each.spin_before for each in states]),
        ("omega_y_after", [each.spin_after for each in states]),
    ):
        if not np.isnan([rate for rate, _ in spins]).all():
            columns[f"{name}_rad_s"] = np.array([rate for rate, _ in spins])
            columns[f"sigma_{name}_rad_s"] = np.array([error for _, error in spins])
    if columns and radius is None:
        raise UsageError(
            f"--radius: {table.file} has angles of a mark. Say how large the ball is, as --radius 20mm."
        )
    if "omega_y_after_rad_s" in columns and "omega_y_rad_s" in columns:
        lacking = [
            each.track
            for each in states
            if np.isnan(each.spin_before[0]) and not np.isnan(each.spin_after[0])
        ]
        for track in lacking[:1]:
            raise DataError(
                f"{track.place}: shows how the ball turns after the impact, but not before, as other runs "
                f"do. Give the "
                "angle of three frames before it, or leave its angles out."
            )
    if columns:
        columns["radius_m"] = np.full(len(states), radius)
    return columns


def _notes(fits: TrackFits, table: Cells, *, spins: bool) -> list[str]:
    """What was done, and what frame rate and pixel do to the errors."""
    states, name = fits.states, table.name
    axes = [axis for axis in AXES if axis in fits.sigma]
    frames = int(np.median([n for each in states for n in each.frames]))
    wrong = ", ".join(f"{1e3 * fits.sigma[axis]:.2g} mm in {axis}" for axis in axes)
    if fits.from_file:
        whence = "as the file gives them"
    elif any(fits.scatter[axis] < 0.999 for axis in axes):
        whence = "by the rounding to pixels or their scatter about the paths"
    else:
        whence = f"by their scatter about the paths, of {fits.dof} degrees of freedom"
    k = len(axes)
    speed = float(np.median([math.sqrt(each.covariance[k - 1, k - 1]) for each in states]))
    runs = "1 impact" if len(states) == 1 else f"{len(states)} impacts"
    notes = [
        f"{name}: {runs}, velocities of {frames} frames on a side (median) over {1e3 * fits.duration:.3g} "
        f"ms; positions "
        f"are wrong by {wrong}, {whence}",
        f"{name}: so a velocity is wrong by {speed:.2g} m/s; pixels half as large halve that, twice the "
        f"frame rate over "
        "the same path divides it by 1.4",
    ]
    if fits.dof < _FEW_DOF and not fits.from_file:
        notes.append(
            f"{name}: a scatter of {fits.dof} degrees of freedom is hardly known, nor are the errors"
        )
    worst = max((fits.scatter[axis] for axis in axes if not math.isnan(fits.scatter[axis])), default=0.0)
    if fits.from_file and worst > _MORE:
        notes.append(
            f"{name}: positions scatter {worst:.1f} times as much about the paths as the file's errors say"
        )
    if fits.acceleration:
        found = ", ".join(f"{fits.acceleration[axis]:.3g} m/s^2 along {axis}" for axis in axes)
        notes.append(f"{name}: sides of fewer than 7 frames share one acceleration, {found}")
    if fits.in_contact:
        count = "1 frame" if fits.in_contact == 1 else f"{fits.in_contact} frames"
        notes.append(
            f"{name}: {count} lay off the free flights, more than the nearest on either side, and were "
            f"left out: the "
            "contact lasts longer than two frames. Say how long, as --contact 2ms; those that lie off by "
            "less are not "
            "seen"
        )
    if spins:
        notes.append(
            f"{name}: the ball is taken to turn by less than half a turn from frame to frame; faster spins "
            f"would look "
            "like slower ones"
        )
    return notes
