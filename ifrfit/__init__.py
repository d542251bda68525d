"""ifrfit: restitution and friction constants from measured impacts of spheres on walls."""

import lazy_loader

from ifrfit._version import __version__ as __version__

# names are imported on first use: `ifrfit --help` must not pay for numpy and pandas
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
