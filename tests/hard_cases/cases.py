"""The table of hard cases: the tests run it, and docs/hard-cases.md is written from it."""

from __future__ import annotations

from hard_cases import identifiable, numerics, ordinary, rebounds, refusals, scenes, slips, strangers
from hard_cases.case import HardCase, by_turns

CASES: tuple[HardCase, ...] = (
    *rebounds.CASES,
    *scenes.CASES,
    *refusals.CASES,
    *identifiable.CASES,
    *by_turns(strangers.CASES),
    *by_turns(slips.CASES),
    *ordinary.CASES,
    *numerics.CASES,
)
