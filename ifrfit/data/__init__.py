"""What was measured: reading, checking, combining and selecting observations."""

from __future__ import annotations

from ifrfit.data.angular_momentum import MomentumCheck
from ifrfit.data.catalogue import load_dataset, resolve
from ifrfit.data.combination import combine
from ifrfit.data.observations import Descriptor, Observations, Source
from ifrfit.data.readers import read
from ifrfit.data.selection import Selection, select
from ifrfit.data.template import template_text

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
