"""Chains in files: there and back, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcmc_targets import Normal
from refusals import refused

from ifrfit.errors import DataError, UsageError
from ifrfit.inference.mcmc import Chains, begin, run
from ifrfit.inference.mcmc.checkpoint import FILE, keep_chains, kept_chains, load_chains, save_chains


@pytest.fixture(scope="module")
def chains() -> Chains:
    return run(Normal(), begin(Normal(), Normal().starts(), np.random.SeedSequence(1)), max_steps=30)[0]


def test_there_and_back(chains: Chains, tmp_path: Path) -> None:
    save_chains(tmp_path / FILE, chains, "q")
    assert [p.name for p in tmp_path.iterdir()] == [FILE]
    for place in (tmp_path, tmp_path / FILE):
        found = load_chains(place, "q")
        assert np.array_equal(found.at, chains.at)
        assert np.array_equal(found.log_density, chains.log_density)
        assert np.array_equal(found.accepted, chains.accepted)
        further = [run(Normal(), each, max_steps=40)[0].at for each in (found, chains)]
        assert np.array_equal(*further)


def test_no_chains(tmp_path: Path) -> None:
    with refused(UsageError, match="there are no chains to resume"):
        load_chains(tmp_path, "q")


def test_chains_of_another_question(chains: Chains, tmp_path: Path) -> None:
    save_chains(tmp_path / FILE, chains, "q")
    with refused(UsageError, match="other data, choices or another seed"):
        load_chains(tmp_path, "another")


@pytest.mark.parametrize("content", [b"", b"junk", b"PK\x03\x04 no archive", b"\x80\x04."])
def test_damaged_files(content: bytes, tmp_path: Path) -> None:
    (tmp_path / FILE).write_bytes(content)
    with refused(DataError, match="cannot be read as chains"):
        load_chains(tmp_path, "q")


def arrays(chains: Chains, folder: Path) -> dict[str, np.ndarray]:
    save_chains(folder / FILE, chains, "q")
    with np.load(folder / FILE) as file:
        return {name: file[name] for name in file.files}


@pytest.mark.parametrize(
    "change",
    [
        {"schema": np.array("other")},
        {"at": np.zeros((4, 30, 32))},
        {"at": np.full((4, 30, 32, 2), np.nan)},
        {"log_density": np.zeros((4, 29, 32))},
        {"key": np.zeros((4, 10), np.uint32)},
        {"key": np.zeros((4, 624))},
        {"pos": np.array([0, 1, 2, 700])},
        {"accepted": np.zeros(3)},
    ],
)
def test_arrays_that_do_not_fit_together(
    chains: Chains, tmp_path: Path, change: dict[str, np.ndarray]
) -> None:
    np.savez(tmp_path / FILE, **(arrays(chains, tmp_path) | change))
    with refused(DataError, match="Run again without --resume"):
        load_chains(tmp_path, "q")


def test_a_missing_array(chains: Chains, tmp_path: Path) -> None:
    content = arrays(chains, tmp_path)
    del content["key"]
    np.savez(tmp_path / FILE, **content)
    with refused(DataError, match="do not fit together"):
        load_chains(tmp_path, "q")


def test_objects_are_never_unpacked(chains: Chains, tmp_path: Path) -> None:
    np.savez(tmp_path / FILE, **(arrays(chains, tmp_path) | {"at": np.array([{}], dtype=object)}))
    with refused(DataError, match="cannot be read as chains"):
        load_chains(tmp_path, "q")


def test_chains_that_are_kept_are_those_of_the_question_alone(chains: Chains, tmp_path: Path) -> None:
    folder = tmp_path / "deep" / "unfinished"
    assert kept_chains(folder, "this") is None
    keep_chains(folder, chains, "this")
    assert kept_chains(folder, "another") is None
    again = kept_chains(folder, "this")
    assert again is not None
    np.testing.assert_array_equal(again.at, chains.at)
    (folder / "chains.npz").write_bytes(b"junk")
    with pytest.raises(DataError, match="cannot be read as chains"):
        kept_chains(folder, "this")


def test_a_disk_that_takes_nothing_is_told_in_a_sentence(chains: Chains, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(UsageError, match="what was found so far cannot be written"):
        keep_chains(tmp_path / "file" / "unfinished", chains, "this")
