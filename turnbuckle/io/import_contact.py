"""Contact of an imported scene, turned on when the user asks for it (`turnbuckle import --contact`).

Contact is off otherwise: what is drawn of a robot often overlaps, and a scene that starts with bodies inside each other
is refused. Pairs that overlap at the start are therefore left out by name, as MuJoCo leaves out a body and its parent.
"""

from typing import Any

from turnbuckle.io.imported import APART, CONTACT_OFF, Imported
from turnbuckle.scene.check_contact import crossing_bodies
from turnbuckle.scene.scene import Scene
from turnbuckle.scene.validation import given_data


def with_contact(found: Imported) -> Imported:
    """The scene with contact, pairs that overlap at the start left out of it and named. Raises `InputError`."""
    told = [text for text in found.left_out if text != CONTACT_OFF and not text.startswith(APART)]
    ignore = [list(pair) for pair in found.apart]
    scene = _scene(found.scene, ignore)
    if scene.definition.bodies:
        crossing = crossing_bodies(*scene.build())
        for one, other, _ in crossing:
            if one != other:
                ignore.append([one, other])
                told.append(f"bodies '{one}' and '{other}' overlap at the start and pass each other (contact.ignore)")
            else:
                told.append(f"body '{one}' crosses itself at the start")
        scene = _scene(found.scene, ignore) if crossing else scene
    return Imported(scene, told, found.apart)


def _scene(scene: Scene, ignore: list[list[str]]) -> Scene:
    data: dict[str, Any] = given_data(scene.definition)
    data["contact"] = {"ignore": ignore} if ignore else True
    return Scene.from_dict(data, scene.folder)
