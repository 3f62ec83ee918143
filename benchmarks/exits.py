"""Whether a process that reads an archive ends as it should, also where many threads want few processors.

    python benchmarks/exits.py [--exits 1000] [--busy 4] [--at-once 4] [--reads 20]

A reader once did its work, printed its answer, and was aborted at its end, since a thread of a library was
still alive. Readers are started here beside processes that only compute; each reads an archive many times,
the last time right before its end. Prints how many ended with status 0 and a whole answer, and what the
others said.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor

READER = """
import sys
from nichechain.archive.archive import load

for _ in range(int(sys.argv[2])):
    archive = load(sys.argv[1])
    births, counts = archive.births(), archive.counts_of()
print(len(births), int(counts.visits.sum()))
"""
BUSY = "while True: pass"


def main() -> None:
    """Start readers until so many have ended."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--exits", type=int, default=1000)
    parser.add_argument("--busy", type=int, default=4, help="processes that only compute")
    parser.add_argument("--at-once", type=int, default=4, help="readers side by side")
    parser.add_argument("--reads", type=int, default=20, help="reads of each reader")
    parser.add_argument("--archive", default="fetch-pick-and-place")
    options = parser.parse_args()
    command = [sys.executable, "-c", READER, options.archive, str(options.reads)]

    def read(_: int) -> str:
        ended = subprocess.run(command, capture_output=True, text=True, check=False)
        if ended.returncode == 0 and len(ended.stdout.split()) == 2:
            return "clean"
        return f"status {ended.returncode}: {(ended.stderr.strip().splitlines() or [''])[-1]}"

    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(options.busy)]
    began = time.monotonic()
    try:
        with ThreadPoolExecutor(options.at_once) as pool:
            ends = Counter(pool.map(read, range(options.exits)))
    finally:
        for process in busy:
            process.kill()
    print(
        f"{options.exits} readers beside {options.busy} busy processes in {time.monotonic() - began:.0f} s:"
    )
    for end, number in ends.most_common():
        print(f"  {number:5d}  {end}")
    sys.exit(ends["clean"] != options.exits)


if __name__ == "__main__":
    main()
