"""The bootstrap: how the constants scatter over experiments drawn anew from the one that was made."""

from ifrfit.inference.resampling.bootstrap import REPLICATES as REPLICATES
from ifrfit.inference.resampling.bootstrap import Bootstrap as Bootstrap
from ifrfit.inference.resampling.bootstrap import bootstrap as bootstrap
from ifrfit.inference.resampling.schemes import SCHEMES as SCHEMES
