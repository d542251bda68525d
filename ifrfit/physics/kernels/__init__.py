"""Compiled loops for very many impacts with one set of constants."""

from ifrfit.physics.compiling import available as available
from ifrfit.physics.kernels.rebound_many import Many as Many
from ifrfit.physics.kernels.rebound_many import has_loop as has_loop
from ifrfit.physics.kernels.rebound_many import rebound_many as rebound_many
