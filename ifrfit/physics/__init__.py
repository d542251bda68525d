"""What happens in an impact: closures, the rebound, observables and the transition."""

from ifrfit.physics.closure import Closure
from ifrfit.physics.closures import CLOSURES, get_closure
from ifrfit.physics.observable import Observable
from ifrfit.physics.observables import OBSERVABLES
from ifrfit.physics.rebound import Rebound, rebound
from ifrfit.physics.transition import transition_angles, transition_tau

__all__ = [
    "CLOSURES",
    "OBSERVABLES",
    "Closure",
    "Observable",
    "Rebound",
    "get_closure",
    "rebound",
    "transition_angles",
    "transition_tau",
]
