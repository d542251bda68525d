"""`python -m ifrfit`."""

from ifrfit.cli import main

main()
