"""What a page of the gallery writes into its folder, pictures (.png, .svg) and films (.mp4), is moved into the built pages.

A scraper of sphinx-gallery (`image_scrapers` in `conf.py`). A picture of the same name as a film is its thumbnail only.
"""

import shutil
from pathlib import Path
from typing import Any

from sphinx_gallery.scrapers import figure_rst

FILM = """
.. video:: /{path}
   :autoplay:
   :loop:
   :muted:
   :playsinline:
   :width: 100%
"""


def scrape(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """The text (rst) that shows the files made by a block of a page."""
    folder, source = Path(block_vars["src_file"]).parent, Path(gallery_conf["src_dir"])
    shown = []
    films = sorted(folder.glob("*.mp4"))
    for picture in sorted(path for path in folder.iterdir() if path.suffix in (".png", ".svg")):
        place = Path(next(block_vars["image_path_iterator"])).with_suffix(picture.suffix)
        shutil.move(picture, place)
        if picture.with_suffix(".mp4") not in films:
            shown.append(figure_rst([str(place)], str(source), picture.stem.replace("_", " ")))
    for film in films:
        images = Path(str(block_vars["image_path_iterator"].image_path)).parent  # its numbers are for pictures alone
        place = images / f"{Path(block_vars['src_file']).stem}_{film.name}"
        shutil.move(film, place)
        shown.append(FILM.format(path=place.relative_to(source).as_posix()))
    return "\n".join(shown)


def _get_sg_image_scraper() -> Any:
    """Asked for by sphinx-gallery."""
    return scrape
