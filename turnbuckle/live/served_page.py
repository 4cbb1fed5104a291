"""The HTML that is served or stands alone: viser's, and before it our scripts."""

import gzip
from functools import lru_cache
from pathlib import Path

SOFTWARE = Path(__file__).with_name("software.js")  # for browsers that draw without a graphics card
ALONE = Path(__file__).with_name("alone.js")
HEAD = b"<head>"


@lru_cache(maxsize=4)
def with_script(body: bytes, packed: bool) -> bytes:
    """A page to serve, with `software.js` first in its head; ``packed``: by gzip. What has no head stays as it is."""
    page = gzip.decompress(body) if packed else body
    changed = _first(page, SOFTWARE)
    if changed is page:
        return body
    return gzip.compress(changed, 6) if packed else changed


def standing_alone(page: str) -> str:
    """A page that needs no server, with our scripts first in its head."""
    return _first(page.encode(), SOFTWARE, ALONE).decode()


def _first(page: bytes, *scripts: Path) -> bytes:
    before, head, after = page.partition(HEAD)
    if not head:
        return page
    return before + head + b"".join(b"<script>" + s.read_bytes() + b"</script>" for s in scripts) + after
