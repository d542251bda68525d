"""A text file is read in parts that begin at lines, with the same result, and lines keep their numbers."""

from __future__ import annotations

import numpy as np
import pytest
from streams import impacts

import ifrfit
from ifrfit.data.stream import files, portions
from ifrfit.errors import DataError
from ifrfit.inference.estimators import LeastSquares


@pytest.fixture(autouse=True)
def few_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(files, "LARGE_BYTES", 0)
    monkeypatch.setattr(portions, "_TEXT_BYTES", 30_000)
    monkeypatch.setattr(portions, "FIRST_ROWS", 500)
    monkeypatch.setattr(portions, "ROWS", 1500)


def written(path, table, end="\n"):
    path.write_text(table.to_csv(index=False, lineterminator=end), encoding="utf-8", newline="")
    return path


def pieces(path):
    return [piece for portion in portions.portions_of([path]) for piece in portion]


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_file_in_parts_is_fitted_to_the_same_bits(tmp_path, monkeypatch, end) -> None:
    path = written(tmp_path / "a.csv", impacts(4000, series=3), end)
    parts = pieces(path)
    assert len(parts) > 4
    assert [piece.first for piece in parts[1:]] == [piece.end for piece in parts[:-1]]
    assert (parts[0].first, parts[-1].end) == (0, path.stat().st_size)
    text = path.read_bytes()
    assert all(text[piece.end - 1 : piece.end] == b"\n" for piece in parts)
    in_parts = ifrfit.fit(path, method="lsq")
    monkeypatch.setattr(portions, "_TEXT_BYTES", 10**9)
    assert len(pieces(path)) == 1
    whole = ifrfit.fit(path, method="lsq")
    assert in_parts.fit == whole.fit
    np.testing.assert_array_equal(
        [one.value for one in in_parts.constants.values()], [one.value for one in whole.constants.values()]
    )


def test_two_processes_share_one_text_file(tmp_path) -> None:
    path = written(tmp_path / "a.csv", impacts(4000))
    alone = ifrfit.fit(path, method="lsq")
    shared = ifrfit.fit(path, method=LeastSquares(workers=2))
    assert shared.fit == alone.fit


@pytest.mark.parametrize("row", [0, 700, 2500, 3999])
def test_what_is_left_out_has_its_line_in_the_file(tmp_path, row) -> None:
    table = impacts(4000)
    table.loc[row, "gamma_deg"] = 95.0
    path = written(tmp_path / "a.csv", table)
    found = ifrfit.fit(path, method="lsq")
    assert any(f"line {row + 2}" in warning for warning in found.warnings), found.warnings


def test_a_broken_line_is_named_by_its_number_in_the_file(tmp_path) -> None:
    lines = impacts(4000).to_csv(index=False).splitlines()
    lines[3000] = "1,2"
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(DataError, match="Row #3001"):
        ifrfit.fit(path, method="lsq")


def test_blank_lines_at_the_end_are_no_rows(tmp_path) -> None:
    path = written(tmp_path / "a.csv", impacts(2000))
    whole = ifrfit.fit(path, method="lsq")
    path.write_text(path.read_text(encoding="utf-8") + "\n" * 50_000, encoding="utf-8")
    assert ifrfit.fit(path, method="lsq").fit == whole.fit


def test_a_compressed_file_is_one_part(tmp_path) -> None:
    path = tmp_path / "a.csv.gz"
    impacts(4000).to_csv(path, index=False)
    assert len(pieces(path)) == 1
