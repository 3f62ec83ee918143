"""What kind of machine this is."""

from __future__ import annotations

import json
import os
import platform
import subprocess
import sys

import pytest

from nichechain.core.machine import machine


def test_the_machine_is_the_same_whenever_it_is_asked_for() -> None:
    facts = machine()
    assert facts["machine"] == platform.machine()
    assert facts["system"] == platform.system()
    assert all(isinstance(value, str) and value for value in facts.values())
    code = "import json; from nichechain.core.machine import machine; print(json.dumps(machine()))"
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, text=True).stdout
    assert json.loads(told) == facts


def test_other_vector_instructions_make_another_machine() -> None:
    code = "import json; from nichechain.core.machine import machine; print(json.dumps(machine()))"
    found = [group for group in machine()["simd"].split() if group.startswith(("AVX512", "X86_V4"))]
    if not found:
        pytest.skip("NumPy has no instructions here that can be switched off")
    fewer = {**os.environ, "NPY_DISABLE_CPU_FEATURES": ",".join(found)}
    told = json.loads(
        subprocess.run(
            [sys.executable, "-c", code], capture_output=True, check=True, text=True, env=fewer
        ).stdout
    )
    assert not set(told["simd"].split()) & set(found)
    assert told["numpy_math"] != machine()["numpy_math"]
    # NumPy's choice of instructions is none of the C library's business.
    assert told["libm"] == machine()["libm"]
