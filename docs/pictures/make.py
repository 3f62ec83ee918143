"""Draw the pictures of the documentation, from the shipped archive, results and the examples.

``python docs/pictures/make.py [NAME ...]`` draws all of them, or those of the given names, beside
this file; all together it takes some minutes. ``explorer`` needs Selenium and Chromium.
"""

from __future__ import annotations

import sys

import of_archive
import of_pages
import of_results
import of_walks
from matplotlib.figure import Figure
from saving import save

DRAWN = {**of_archive.PICTURES, **of_walks.PICTURES, **of_results.PICTURES}


def draw(name: str) -> None:
    """Draw the picture of that name, as it is made."""
    if name in of_pages.PICTURES:
        of_pages.PICTURES[name]()
    elif name in of_results.STUDIES:
        save(of_results.study(name), name)
    else:
        figure = Figure()
        DRAWN[name](figure)
        save(figure, name)


if __name__ == "__main__":
    for picture in sys.argv[1:] or [*DRAWN, *of_results.STUDIES, *of_pages.PICTURES]:
        draw(picture)
