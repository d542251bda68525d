"""Charts of the page: what they show as values, and the writer that makes an svg of them.

Figures that are published are matplotlib's (`ifrfit.report.figures`); a page has a dozen small charts, for
which that would take seconds.
"""
