"""Markov chain Monte Carlo that stops on evidence: independent ensembles of emcee are the chains.

Importing this package imports emcee.
"""

from ifrfit.inference.mcmc.run import MAX_STEPS as MAX_STEPS
from ifrfit.inference.mcmc.run import Chains as Chains
from ifrfit.inference.mcmc.run import begin as begin
from ifrfit.inference.mcmc.run import run as run
from ifrfit.inference.mcmc.sample import Sample as Sample
from ifrfit.inference.mcmc.sample import fresh as fresh
from ifrfit.inference.mcmc.sample import sample as sample
from ifrfit.inference.mcmc.starts import Coordinates as Coordinates
from ifrfit.inference.mcmc.starts import starts as starts
from ifrfit.inference.mcmc.stopping import Evidence as Evidence
from ifrfit.inference.mcmc.stopping import verdict_of as verdict_of
