"""Scene and effects of a result.json, read back."""

from __future__ import annotations

from ifrfit.inference.diagnostics.omitted_effects.types import EffectLine, SceneOfData
from ifrfit.inference.io.json_node import Node


def scene_from(node: Node) -> SceneOfData:
    """The key ``scene``."""
    return SceneOfData(
        node["origin"].text(),
        node["body"].text(),
        node["wall"].text(),
        tuple(node["known"].each(lambda item: item.text())),
        tuple(node["unknown"].each(lambda item: item.text())),
    )


def effect_from(node: Node) -> EffectLine:
    """One item of the key ``effects``."""
    met = node["met"]
    if met.value is not None:
        met.check(bool)
    return EffectLine(
        node["effect"].text(),
        node["criterion"].text(),
        node["value"].maybe(),
        node["threshold"].maybe(),
        met.value,
        node["change"].maybe(),
        node["observable"].text(),
        node["unit"].text(),
        node["signal"].maybe(),
        node["says"].text(),
    )
