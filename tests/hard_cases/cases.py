"""The table of hard cases: the tests run it, and docs/hard-cases.md is written from it."""

from __future__ import annotations

from hard_cases import identifiable, numerics, rebounds, refusals, scenes, strangers
from hard_cases.case import HardCase

CASES: tuple[HardCase, ...] = (
    *rebounds.CASES,
    *scenes.CASES,
    *refusals.CASES,
    *identifiable.CASES,
    *strangers.CASES,
    *numerics.CASES,
)
