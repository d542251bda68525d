"""A target of one's own: restitution and friction of a game engine, two numbers and no spin of its own."""

from dataclasses import dataclass

from ifrfit.exporters.exported_constants import ExportedConstants
from ifrfit.exporters.protocol import HASH, Comments, Conditions, Response, Translation
from ifrfit.physics.angles import Incidence


@dataclass(frozen=True)
class Arcade:
    """Bounciness and grip, where grip is the lost share of the velocity along the wall."""

    name: str = "arcade"
    title: str = "Arcade"
    comments: Comments = HASH
    takes: frozenset[str] = frozenset()

    def translate(self, constants: ExportedConstants, at: Conditions) -> Translation:
        """The text, and the law that the engine makes of it."""
        grip = min(constants.mu, 1.0)

        def response(incidence: Incidence) -> Response:
            return Response(constants.e_n * incidence.cosine, (1.0 - grip) * incidence.sine)

        return Translation(
            lines=[f"bounciness = {constants.e_n:.10g}", f"grip = {grip:.10g}"],
            law="v_n = bounciness u_n, v_t = (1 - grip) u_t.",
            mapping=["bounciness = e_n, grip = mu, at most 1."],
            holds="nowhere in particular; see the residual.",
            response=response,
        )


ARCADE = Arcade()
