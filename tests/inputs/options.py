"""Bad values by what an option takes, and of the options that several commands have."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Bad = Mapping[str, Sequence[str]]
"""Bad values by the names of options."""

# Words that are no numbers, and numbers that are none of ours, by what an option takes.
COUNT = ("0", "-1", "1.5", "three", "nan", "")
NATURAL = ("-1", "1.5", "three", "nan", "")
REAL = ("three", "")
POSITIVE = ("0", "-1", "nan", "inf", *REAL)
SHARE = ("-0.1", "1.1", "nan", *REAL)
UNKNOWN = ("no-such-thing", "3", "")
MEMORY = ("-1", "two", "2TB", "1.5.2GB", "")
WORKERS = ("0", "-1", "three", "threads:0", "processes:x", "processes:1000000", "ray:x")
NICHE = ("9,9", "-1", "a", "0,", "0;0", "1,2,3", "999", "")
GRID = ("0x2", "2", "axb", "2x", "-1x2", "1000000x1000000", "2x2x2", "")
BOUNDS = ("0,1", "1,0,0,1", "0,nan,0,1", "a,b,c,d", "0,1,0", "")
PATH = ("/no/such/folder", "no-such-archive")
STEPS = ("3:1", "0:0", "-1:2", "three", "9999:", "")
WORDS = ("joints", "joints=0", "no_such_option=3", "=3")
STEP_BOUND = ("rescaled", "rescaled:0", "no-such-kind:1", "rescaled:x")

SCORES = {"l": COUNT, "lineages": COUNT, "seed": NATURAL}
ESTIMATOR = {"estimator": UNKNOWN}
WORK = {"workers": WORKERS, "cache_memory": MEMORY}

SEARCH: Bad = {
    "domain": ("no-such-thing", "3", "gym:", "gym:NoSuch-v0"),
    "evaluations": COUNT,
    "grid": GRID,
    "niches": ("cvt:0", "cvt", "cvt:x", "400", "voronoi:4"),
    "niches_seed": NATURAL,
    "bounds": BOUNDS,
    "initial": COUNT,
    "batch": COUNT,
    "mutation": UNKNOWN,
    "scale": POSITIVE,
    "df": (*POSITIVE, "3"),
    "step_bound": (*STEP_BOUND, "rescaled:nan"),
    "layer_scales": ("0", "a", "1,nan", "1,1", ""),
    "temperature": POSITIVE,
    "selection_l": COUNT,
    "selection_lineages": COUNT,
    "lineage_share": ("1", *SHARE),
    "lineage_length": ("1", *COUNT),
    "lineage_brood": COUNT,
    "replacement": UNKNOWN,
    "outside": UNKNOWN,
    "seed": NATURAL,
    "domain_seed": NATURAL,
    "descriptor": ("final-xy",),
    "controller": ("mlp:4", "lstm"),
    "steps": ("0", "three", "5"),
    "noise": ("action", "action:x", "action:-1", "wind:1"),
    "repeats": COUNT,
    "options": (*WORDS, "joints=1.5"),
    **WORK,
}
"""Options of a search, be it built alone or one of a study."""

WALKS: Bad = {
    "domain": UNKNOWN,
    "out": ("{archive}/meta.json",),
    "runs": COUNT,
    "offspring": COUNT,
    "mutation": UNKNOWN,
    "scale": POSITIVE,
    "step_bound": STEP_BOUND,
    "k": COUNT,
    "archive_limit": COUNT,
    "archive_scope": UNKNOWN,
    "states": COUNT,
    "litter": COUNT,
    "initialisation": ("no-such-thing", "normal:0", "normal:x", "orthogonal", "elites:/no/such/folder"),
    "grid": GRID,
    "bounds": BOUNDS,
    "seed": NATURAL,
    "domain_seed": NATURAL,
    "options": WORDS,
    "steps": NATURAL,
    **WORK,
}
"""Options of any study of walks."""

LEVEL = ("no-such-thing", "2", "0", "-0.5", "nan")
KDE = {"bandwidth": POSITIVE, "mode": UNKNOWN, "decay": ("0", "1.1", "nan", *REAL)}
