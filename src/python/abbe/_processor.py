"""Processors that the extension module is not built for: a sentence instead of the end of the process."""

from __future__ import annotations

import platform
import sys

SENTENCE = (
    "abbe is built for x86 processors with AVX2 and FMA (since about 2013 to 2015), and this one has none; "
    'build it for this one with: RUSTFLAGS="-C target-cpu=x86-64" pip install --no-binary abbe .'
)


def lacks_avx2(flags: set[str]) -> bool:
    """Whether a processor with these flags, as /proc/cpuinfo names them, cannot run the module.

    Of a processor whose flags are not known, nothing is said.
    """
    return bool(flags) and not {"avx2", "fma"} <= flags


def flags() -> set[str]:
    """Flags of this processor; none where the system does not tell."""
    if platform.machine().lower() not in ("x86_64", "amd64"):
        return set()
    if sys.platform == "linux":
        try:
            with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
                for line in file:
                    if line.startswith("flags"):
                        return set(line.partition(":")[2].split())
        except OSError:
            pass
    elif sys.platform == "darwin":
        import subprocess

        names = ["machdep.cpu.features", "machdep.cpu.leaf7_features"]
        told = subprocess.run(["sysctl", "-n", *names], capture_output=True, text=True, check=False)
        return set(told.stdout.lower().split())
    elif sys.platform == "win32":
        import ctypes

        # PF_AVX2_INSTRUCTIONS_AVAILABLE; processors with AVX2 have FMA
        has_avx2 = ctypes.windll.kernel32.IsProcessorFeaturePresent(40)
        return {"avx2", "fma"} if has_avx2 else {"none"}
    return set()


def check() -> None:
    """Raises an ImportError where the module would end the process."""
    if lacks_avx2(flags()):
        raise ImportError(SENTENCE)
