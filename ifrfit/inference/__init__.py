"""How constants are recovered: problem, least squares with a certificate, statuses and facts."""

import lazy_loader

# who fits does not pay for the modules that compare and simulate
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
