"""An archive is a folder: elites, births, and what made them."""

from nichechain.archive.archive import Archive, Elite, load, shipped
from nichechain.archive.building import build
from nichechain.archive.calibrating import calibrate
from nichechain.archive.exports import (
    genealogy,
    write_dot,
    write_edges,
    write_genealogy,
    write_gexf,
    write_graphml,
    write_phylogeny,
    write_stn,
)
from nichechain.archive.filling import BuildProgress
from nichechain.archive.imported import Axes, import_births
from nichechain.archive.log_columns import Columns
from nichechain.archive.merge import merge

__all__ = [
    "Archive",
    "Axes",
    "BuildProgress",
    "Columns",
    "Elite",
    "build",
    "calibrate",
    "genealogy",
    "import_births",
    "load",
    "merge",
    "shipped",
    "write_dot",
    "write_edges",
    "write_genealogy",
    "write_gexf",
    "write_graphml",
    "write_phylogeny",
    "write_stn",
]
