"""The bootstrap: how the constants scatter over experiments drawn anew from the one that was made."""

from ifrfit.inference.bootstrap.estimator import REPLICATES as REPLICATES
from ifrfit.inference.bootstrap.estimator import BootstrapDraws as BootstrapDraws
from ifrfit.inference.bootstrap.estimator import bootstrap as bootstrap
from ifrfit.inference.bootstrap.schemes import SCHEMES as SCHEMES
