"""Closures side by side: evidence, cross-validation and discriminators of the same impacts."""

from ifrfit.inference.comparison.compare import compare as compare
from ifrfit.inference.comparison.compare import compare_result as compare_result
from ifrfit.inference.comparison.result import Comparison as Comparison
