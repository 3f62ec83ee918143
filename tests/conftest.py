"""What all tests share."""

import math
import re
import signal
from collections.abc import Callable

import pytest
from hypothesis import settings

import nichechain as nc

# Tests assert numbers, not speed: a busy machine fails none of them.
settings.register_profile("nichechain", deadline=None)
settings.load_profile("nichechain")

# A shell makes what it runs in the background deaf to Ctrl-C, and that is inherited.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


_NUMBER = re.compile(r"-?\d+(?:\.\d+)?")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Let ``pytest --refresh-docs tests/test_docs.py`` write what blocks print into their pages."""
    parser.addoption("--refresh-docs", action="store_true", help="rewrite the outputs shown in the docs")


@pytest.fixture
def alike() -> Callable[[str, str], bool]:
    """Whether two texts agree in their words, and in their numbers to 1 % or the last digit shown."""

    def close(a: str, b: str) -> bool:
        digits = len(b.partition(".")[2])
        return math.isclose(float(a), float(b), rel_tol=0.01, abs_tol=1.01 * 10.0**-digits)

    def compare(said: str, shown: str) -> bool:
        words = [_NUMBER.sub("#", " ".join(text.split())) for text in (said, shown)]
        numbers = [_NUMBER.findall(text) for text in (said, shown)]
        return words[0] == words[1] and all(map(close, *numbers))

    return compare


@pytest.fixture(scope="session")
def arm_archive(tmp_path_factory: pytest.TempPathFactory) -> nc.Archive:
    """A small archive of the arm, to read from."""
    folder = tmp_path_factory.mktemp("shared") / "arm"
    config = nc.BuildConfig("arm", (6, 9), ((-1, 1), (-1, 1)), evaluations=800, scale=0.5)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)
