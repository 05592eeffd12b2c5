"""Compiles the kernels when cpbench is built; without a C compiler it is built without them, and says so."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

LEVELS = "CPBENCH_LEVELS"
"""Levels of instructions to build for, as `v2,v3`; unset, that of this processor."""


class KernelHook(BuildHookInterface):
    """Compiles the kernels into libraries beside them, before their files are collected."""

    PLUGIN_NAME = "custom"

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Compile what has changed; the wheel is then for this kind of machine."""
        script = Path(self.root) / "cpbench" / "foundation" / "kernel_build.py"
        levels = [f"--level={level}" for level in os.environ.get(LEVELS, "").split(",") if level]
        done = subprocess.run([sys.executable, script, *levels], stderr=subprocess.PIPE, text=True)
        if done.returncode:
            self.app.display_warning(f"{done.stderr}built without compiled kernels: Python runs them, slowly")
            return
        build_data["pure_python"], build_data["infer_tag"] = False, True
