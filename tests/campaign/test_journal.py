"""What an unfinished campaign keeps, whoever else writes there and however it ended."""

from __future__ import annotations

import pytest
from refusals import refused

from ifrfit.campaign.journal import Journal
from ifrfit.errors import UsageError

ROW = {"failure": "", "mu": 0.1}


def opened(out, question="ours", **options):
    return Journal.open(out, question, **{"resume": False, "force": False, **options})


def add(journal, name, mu=0.1):
    journal.add([(name,)], [f"digest {name}"], [ROW | {"mu": mu}])


def known(journal):
    return {key[0]: row["mu"] for (key, _), row in journal.known.items()}


def test_lines_of_another_question_are_no_answers(tmp_path):
    """100 of 500 rows of a campaign were those of another one, which had begun before it."""
    out = tmp_path / "out"
    ours = opened(out)
    add(ours, "a")
    theirs = opened(out, "theirs", force=True)
    add(theirs, "b", 0.2)
    add(ours, "c", 0.3)
    assert known(opened(out, "theirs", resume=True)) == {"b": 0.2}
    with refused(UsageError, match="asked something else"):
        opened(out, resume=True)


def test_a_journal_that_is_another_campaigns_by_now_stays(tmp_path):
    out = tmp_path / "out"
    ours, theirs = opened(out), opened(out, "theirs", force=True)
    add(theirs, "b", 0.2)
    ours.close()
    assert known(opened(out, "theirs", resume=True)) == {"b": 0.2}
    theirs.close()
    assert not theirs.path.exists()
    add(ours, "a")  # without a head, which the other one took with it
    assert known(opened(out, resume=True)) == {"a": 0.1}
    ours.close()
    assert not ours.path.exists()


@pytest.mark.parametrize(
    "bad",
    [b"garbage\n", b'{"key": ["b"], "dig\n', b"\xff\xfe\n", b"[1]\n", b'{"of": 1, "key": "b"}\n', b"null\n"],
)
def test_a_line_that_cannot_be_read_is_passed_over_and_said(tmp_path, bad):
    """It was an internal error, and a bug."""
    out = tmp_path / "out"
    journal = opened(out)
    add(journal, "a")
    with journal.path.open("ab") as more:
        more.write(bad)
    add(journal, "c", 0.3)
    found = opened(out, resume=True)
    assert known(found) == {"a": 0.1, "c": 0.3}
    assert found.unread == (
        "out.unfinished.jsonl: a line could not be read; a group whose row stood there was fitted anew."
    )
    assert opened(out, resume=True).unread == ""


def test_a_head_that_cannot_be_read(tmp_path):
    out = tmp_path / "out"
    journal = opened(out)
    add(journal, "a")
    lines = journal.path.read_bytes().splitlines(keepends=True)
    journal.path.write_bytes(b"\x00\x00\n" + lines[1])
    assert known(opened(out, resume=True)) == {"a": 0.1}
    journal.path.write_bytes(b"a letter to somebody\n")
    with refused(UsageError, match="nothing in it can be read as an unfinished campaign"):
        opened(out, resume=True)
    with refused(UsageError, match="--resume goes on"):
        opened(out)


@pytest.mark.parametrize("resume", [True, False])
@pytest.mark.parametrize("length", [0, 1, 20, 50])
def test_a_campaign_that_was_killed_before_its_head_was_written_is_none(tmp_path, length, resume):
    out = tmp_path / "out"
    journal = opened(out)
    head = journal.path.read_bytes()
    journal.path.write_bytes(head[:length])
    found = opened(out, resume=resume)
    assert found.path.read_bytes() == head
    assert not found.known
    assert not found.unread
