"""The kept plotting library: Vega, Vega-Lite and Vega-Embed as one script without imports."""

from __future__ import annotations

import contextlib
import importlib.util
import os
from importlib import metadata
from pathlib import Path

from cpbench.errors import Unavailable

SNIPPET = "window.vega=vega; window.vegaLite=vegaLite; window.vegaEmbed=vegaEmbed;"
LICENCE = """\
Vega, Vega-Lite and Vega-Embed. Copyright (c) 2013-2025, University of Washington Interactive Data Lab. All rights
reserved. Redistribution and use in source and binary forms, with or without modification, are permitted provided that
the following conditions are met: 1. Redistributions of source code must retain the above copyright notice, this list
of conditions and the following disclaimer. 2. Redistributions in binary form must reproduce the above copyright
notice, this list of conditions and the following disclaimer in the documentation and/or other materials provided with
the distribution. 3. Neither the name of the copyright holder nor the names of its contributors may be used to endorse
or promote products derived from this software without specific prior written permission. THIS SOFTWARE IS PROVIDED BY
THE COPYRIGHT HOLDERS AND CONTRIBUTORS "AS IS" AND ANY EXPRESS OR IMPLIED WARRANTIES, INCLUDING, BUT NOT LIMITED TO, THE
IMPLIED WARRANTIES OF MERCHANTABILITY AND FITNESS FOR A PARTICULAR PURPOSE ARE DISCLAIMED. IN NO EVENT SHALL THE
COPYRIGHT HOLDER OR CONTRIBUTORS BE LIABLE FOR ANY DIRECT, INDIRECT, INCIDENTAL, SPECIAL, EXEMPLARY, OR CONSEQUENTIAL
DAMAGES (INCLUDING, BUT NOT LIMITED TO, PROCUREMENT OF SUBSTITUTE GOODS OR SERVICES; LOSS OF USE, DATA, OR PROFITS; OR
BUSINESS INTERRUPTION) HOWEVER CAUSED AND ON ANY THEORY OF LIABILITY, WHETHER IN CONTRACT, STRICT LIABILITY, OR TORT
(INCLUDING NEGLIGENCE OR OTHERWISE) ARISING IN ANY WAY OUT OF THE USE OF THIS SOFTWARE, EVEN IF ADVISED OF THE
POSSIBILITY OF SUCH DAMAGE."""


_LACKS = "vl-convert-python, which carries the charts: pip install cpbench[page]"


def lacking() -> str:
    """Return why there can be no page with charts, '' where there can."""
    return "" if importlib.util.find_spec("vl_convert") else f"no report.html: it needs {_LACKS}"


def script() -> str:
    """Return the library's JavaScript, 0.9 MB; from the user's cache directory when it was made before.

    Raises Unavailable where the package that carries it is not installed.
    """
    try:
        import vl_convert
    except ImportError as cause:
        raise Unavailable("missing", _LACKS) from cause
    import platformdirs

    kept = (
        Path(platformdirs.user_cache_dir("cpbench", appauthor=False))
        / f"vega-{metadata.version('vl-convert-python')}.js"
    )
    try:
        return kept.read_text(encoding="utf-8")
    except OSError:
        bundle = vl_convert.javascript_bundle(SNIPPET)
    _write_cache(kept, bundle)
    return bundle


def _write_cache(path: Path, text: str) -> None:
    """Write the file whole or not at all; without a cache it is made anew each time, in a few seconds."""
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8")
        part.replace(path)
    except OSError:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
