"""The HTML that is served: viser's, and before it our script for browsers that draw without a graphics card."""

import gzip
from functools import lru_cache
from pathlib import Path

SCRIPT = Path(__file__).with_name("software.js")
HEAD = b"<head>"


@lru_cache(maxsize=4)
def with_script(body: bytes, packed: bool) -> bytes:
    """A page with the script of `software.js` first in its head; ``packed``: by gzip. What has no head stays as it is."""
    page = gzip.decompress(body) if packed else body
    before, head, after = page.partition(HEAD)
    if not head:
        return body
    script = b"<script>" + SCRIPT.read_bytes() + b"</script>"
    page = before + head + script + after
    return gzip.compress(page, 6) if packed else page
