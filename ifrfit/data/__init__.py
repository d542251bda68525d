"""What was measured: reading, checking, combining and selecting observations."""

from __future__ import annotations

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.catalogue import load_dataset, resolve
from ifrfit.data.observations import Descriptor, Observations, Source, combine
from ifrfit.data.readers import read
from ifrfit.data.schema import template_text
from ifrfit.data.selection import Selection, select

__all__ = [
    "Descriptor",
    "MomentumCheck",
    "Observations",
    "Selection",
    "Source",
    "combine",
    "load_dataset",
    "read",
    "resolve",
    "select",
    "template_text",
]
