"""Write docs/notebook.ipynb: its cells stand here, its output is what a kernel gives.

``python scripts/write_notebook.py``; tests/test_notebook.py runs the cells again and compares their text.
"""

from __future__ import annotations

from pathlib import Path

import nbformat
from nbclient import NotebookClient

PAGE = Path(__file__).resolve().parent.parent / "docs" / "notebook.ipynb"

CELLS = (
    """# Glass on glass, in a notebook

24 collisions of equal glass spheres, filmed at Cornell, come with ifrfit. A table of your own is a data
frame with an angle of incidence and what was measured: `ifrfit.fit(df)`.""",
    """>import ifrfit

data = ifrfit.load_dataset("cornell-glass")
data""",
    """One set of constants for impacts that stick and impacts that slide, with the scatter of each observable
found beside them:""",
    """>fit = ifrfit.fit(data)
fit""",
    """>print(fit)""",
    """Constants are a table, with attributes and formats; `to_uncertainties` gives correlated numbers to
calculate with.""",
    """>fit.constants.to_frame()[["value", "stderr", "lo95", "hi95", "status"]].round(4)""",
    """>found = fit.to_uncertainties()
print(f"mu = {fit.constants.mu:.2uS}")
print(f"kappa = {found['mu'] * (1 + found['e_n']):.2u}")""",
    """Pictures go on axes of yours, in your style.""",
    """>%matplotlib inline
import matplotlib.pyplot as plt

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
fit.plot(ax=left)
fit.plot_profile("mu", ax=right);""",
    """>fit.plot_corner();""",
    """What a fit found, and whether all is well:""",
    """>{name: fact.ok for name, fact in fit.facts.items()}""",
    """What it predicts, with credible bands and those of one more measurement:""",
    """>table = fit.predict([15, 30, 60], observable="beta_cm")
table[["gamma_deg", "value", "lo95", "hi95", "new_lo95", "new_hi95"]].round(3)""",
    """Which closure the data prefer:""",
    """>both = ifrfit.compare(data, ["ifr", "fr", "f"], loo=False)
both.table()[["free", "log_evidence", "probability"]].round(3)""",
    """What is wrong is told in Python's words:""",
    """>try:
    ifrfit.fit(data, fix={"en": 0.97})
except ifrfit.UsageError as error:
    print(error)""",
)


def empty() -> nbformat.NotebookNode:
    """The notebook without output."""
    make = {True: nbformat.v4.new_code_cell, False: nbformat.v4.new_markdown_cell}
    cells = [make[text.startswith(">")](text.removeprefix(">")) for text in CELLS]
    for number, cell in enumerate(cells):
        cell["id"] = f"cell-{number}"
    kernel = {"name": "python3", "display_name": "Python 3", "language": "python"}
    return nbformat.v4.new_notebook(cells=cells, metadata={"kernelspec": kernel})


def executed() -> nbformat.NotebookNode:
    """The notebook with its output; nothing of the machine or the hour is kept."""
    notebook = NotebookClient(empty(), timeout=300, kernel_name="python3").execute()
    notebook["metadata"] = empty()["metadata"]
    for cell in notebook.cells:
        cell["metadata"] = {}
    return notebook


def main() -> None:
    """Write the page."""
    nbformat.write(executed(), PAGE)


if __name__ == "__main__":
    main()
