"""The sections of a report, one file a section: see `ifrfit.report.page.plugins`."""
