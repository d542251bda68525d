"""Closures side by side: evidence, cross-validation and discriminators of the same impacts."""

from ifrfit.inference.comparison.again import compare_again as compare_again
from ifrfit.inference.comparison.api import compare as compare
from ifrfit.inference.comparison.result import Comparison as Comparison
