"""How results are shown: text, tables, figures and the folder that holds them."""

import lazy_loader

# names are imported on first use: a table in the terminal must not pay for the pages of a report
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
