"""The stage of the page: camera, light, ground, bodies, and the marks of constraints, contacts and the hand."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from turnbuckle.data.shape import Shape
from turnbuckle.live.drawing import drawn_bodies
from turnbuckle.live.frame import Arrows, Frame
from turnbuckle.live.paint import PULL, PUSH, force_colors, residual_colors
from turnbuckle.viewer.camera import FIELD_OF_VIEW, frame_box
from turnbuckle.viewer.geometry import SceneGeometry

CROWD = 60  # marks; where there are more they are smaller
DOT = 0.007  # of the scene's size: mark of a constraint
ARROW = 0.06  # of the scene's size: the arrow of a contact stronger than most
USUAL, LONGEST = 0.8, 3.0  # which quantile that is; times its length at most
GLASS = 0.35  # opacity
FEW = 4000  # arrows and marks shown at most
GROUND = (216, 220, 227)
LINE = 0.007  # of a cell: half the width of a line on the ground
WINDOW = (900, 800)  # pixels, a usual shape of what is left beside the panel
ROOM = 0.04  # of the scene's size, around it


class Mark:
    """A node of points or lines that is made when there is first something to show, and sent when it changes."""

    def __init__(self, add: Callable[..., Any], color: np.ndarray | None = None) -> None:
        self._add, self._color = add, color
        self._node: Any = None
        self._points: np.ndarray | None = None
        self._colors: np.ndarray | None = None

    def show(self, points: np.ndarray, colors: np.ndarray | None = None) -> None:
        """Show ``points`` in ``colors`` (n, ..., 3) uint8, or in the one colour of the mark."""
        there = len(points) > 0
        if self._node is None:
            if there:
                self._points, self._colors = points.astype(np.float32), colors
                self._node = self._add(points=self._points, colors=self._color if colors is None else colors)
            return
        if self._node.visible != there:
            self._node.visible = there
        if not there:
            return
        points = points.astype(np.float32)
        if self._points is None or not np.array_equal(points, self._points):
            same = self._points is not None and points.shape == self._points.shape
            if colors is not None and not same:  # both in one message each: the old colours are of another length
                self._node.colors = self._colors = colors
            self._points = points
            self._node.points = points
        if colors is not None and not np.array_equal(colors, self._colors):
            self._colors = colors
            self._node.colors = colors


class Stage:
    """Draws frames into a viser scene."""

    def __init__(
        self, server: Any, shapes: Sequence[Shape], x: np.ndarray, up_axis: str, size: float, marks: int = 0
    ) -> None:
        """``x`` (points, 3): the first frame [m]. ``marks``: how many constraints are to be drawn, about."""
        self.size, self.up_axis, self.shapes = max(size, 1e-9), up_axis, list(shapes)
        self._scene = server.scene
        geometry = SceneGeometry(self.shapes, x, up_axis)
        seen = geometry.everything(x)
        seen = seen[np.isfinite(seen).all(axis=1)]
        seen = seen if len(seen) else np.array([-np.ones(3), np.ones(3)])
        low, high = seen.min(axis=0), seen.max(axis=0)
        room = ROOM * float(np.linalg.norm(high - low))
        self.low, self.high = low, high
        self.camera = frame_box(low - room, high + room, up_axis, WINDOW)
        first = server.initial_camera
        first.position, first.look_at, first.up = self.camera.eye, self.camera.target, self.camera.up
        first.fov = FIELD_OF_VIEW
        first.near, first.far = 1e-3 * self.size, 100.0 * self.size + float(np.linalg.norm(self.camera.eye))
        server.scene.set_up_direction("+y" if up_axis == "Y" else "+z")
        self._ground(server, geometry.ground)
        self._sky = server.scene.add_light_hemisphere(
            "/light/sky", sky_color=(255, 255, 255), ground_color=(140, 140, 152), intensity=2.2
        )
        away = self.camera.eye - self.camera.target
        away = away / np.linalg.norm(away)
        lamp = 0.6 * away + 0.8 * self.camera.up - 0.45 * np.cross(self.camera.up, away)
        self._lamp = server.scene.add_light_directional(
            "/light/lamp", intensity=2.0, position=tuple(10.0 * self.size * lamp), cast_shadow=False
        )
        self.light(fine=False)
        floors = _floors(self.shapes, x, geometry.ground, int(np.argmax(self.camera.up)), self.size)
        self.bodies = drawn_bodies(server.scene, self.shapes, x, self.size, floors)
        dot = DOT * self.size * min(1.0, np.sqrt(CROWD / max(marks, 1)))
        scene = server.scene
        thick = DOT * self.size
        slim = {"shaft_radius": 0.18 * thick, "head_radius": 0.5 * thick, "head_length": 1.2 * thick}
        cloud = {"point_shape": "circle", "precision": "float32"}
        push, pull = np.array(PUSH, np.uint8), np.array(PULL, np.uint8)
        self._dots = Mark(partial(scene.add_point_cloud, "/marks/constraints", point_size=dot, **cloud))
        self._axes = Mark(partial(scene.add_line_segments, "/marks/axes", thickness=0.35 * dot))
        self._pins = Mark(partial(scene.add_point_cloud, "/marks/pins", point_size=1.7 * dot, **cloud), pull)
        self._contacts = Mark(partial(scene.add_arrows, "/marks/contacts", **slim), push)
        self._pull = Mark(partial(scene.add_arrows, "/marks/hand", **slim), pull)
        self._usual = 0.0  # [N] of contacts, slowly forgotten, so that arrows do not jump in length
        self.show_marks = self.show_contacts = True
        self.color_by_force = False  # marks of constraints; else by residual

    def _ground(self, server: Any, ground: float | None) -> None:
        """Lines on the ground. viser's own grid and light from all around take a second a frame without a graphics card."""
        axis = int(np.argmax(self.camera.up))
        extent = max(float(np.ptp(np.stack([self.low, self.high]), axis=0).max()), 1e-6)
        height = (self.low[axis] if ground is None else ground) - 1e-3 * extent
        power = 10.0 ** np.floor(np.log10(extent / 4.0))
        cell = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= extent / 4.0)
        middle = np.round(0.5 * (self.low + self.high) / cell) * cell
        half = np.ceil(1.6 * extent / cell) * cell
        across = [k for k in range(3) if k != axis]
        at = np.arange(-half, half + 0.5 * cell, cell)
        strips = []  # flat quads: wide lines cost a browser without a graphics card several times as much
        for along in (0, 1):
            for place in at:
                wide = LINE * cell * (2.5 if round(place / cell) % 5 == 0 else 1.0)
                quad = np.full((4, 3), height)
                quad[:, across[along]] = middle[across[along]] + place + wide * np.array([-1, 1, 1, -1])
                quad[:, across[1 - along]] = middle[across[1 - along]] + half * np.array([-1, -1, 1, 1])
                strips.append(quad)
        faces = np.array([[0, 1, 2], [0, 2, 3]])[None] + 4 * np.arange(len(strips))[:, None, None]
        server.scene.add_mesh_simple(
            "/ground/lines", np.concatenate(strips), faces.reshape(-1, 3), color=GROUND, side="double",
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        corner = np.array([[-half, -half], [half, -half], [half, half], [-half, half]])
        plane = np.zeros((4, 3))
        plane[:, across], plane[:, axis] = corner + middle[across], height
        self._shade = server.scene.add_mesh_simple(
            "/ground/shade", plane, np.array([[0, 1, 2], [0, 2, 3]]), color=(255, 255, 255), opacity=0.0,
            side="double", cast_shadow=False, receive_shadow=0.2, visible=False,
        )  # fmt: skip

    def light(self, fine: bool) -> None:
        """Light from a lamp and the sky; or ``fine``, with shadows and light from all around."""
        scene = self._scene
        self._shade.visible = fine
        self._sky.visible = self._lamp.visible = not fine
        scene.configure_environment_map("warehouse" if fine else None, environment_intensity=0.6)
        scene.configure_default_lights(enabled=fine, cast_shadow=fine)

    def see_through(self, on: bool) -> None:
        """Bodies as glass, so that joints inside are seen."""
        for body in self.bodies:
            body.node.opacity = GLASS if on else None

    def show(self, frame: Frame) -> None:
        """Draw a frame. Call it within one atomic block."""
        for body in self.bodies:
            body.update(frame.x)
        self._show_constraints(frame)
        self._show_contacts(frame.contacts)
        self._pins.show(frame.pins)
        pull = frame.pull
        self._pull.show(np.zeros((0, 2, 3)) if pull is None else np.stack([pull.place, pull.target])[None])

    def _show_constraints(self, frame: Frame) -> None:
        marks = frame.marks
        if not self.show_marks or len(marks.points) > FEW or not frame.readings:
            self._dots.show(np.zeros((0, 3)))
            self._axes.show(np.zeros((0, 2, 3)))
            return
        readings = frame.readings
        color = force_colors(readings) if self.color_by_force else residual_colors(readings, self.size)
        self._dots.show(marks.points, color[marks.of])
        self._axes.show(marks.axes, np.repeat(color[marks.axis_of][:, None], 2, axis=1))

    def _show_contacts(self, contacts: Arrows) -> None:
        points = np.zeros((0, 2, 3))
        if self.show_contacts and len(contacts.force):
            strength = np.linalg.norm(contacts.force, axis=1)
            self._usual = max(0.97 * self._usual, float(np.quantile(strength, USUAL)), 1e-300)
            largest = np.sort(np.argsort(-strength)[:FEW])
            length = ARROW * self.size * np.minimum(strength / self._usual, LONGEST)
            ends = contacts.at + (length / np.maximum(strength, 1e-300))[:, None] * contacts.force
            points = np.stack([contacts.at, ends], axis=1)[largest]
        self._contacts.show(points)


def _floors(shapes: Sequence[Shape], x: np.ndarray, ground: float | None, up: int, size: float) -> set[int]:
    """Shapes that are the ground itself: wide, still, without a colour, at its height. Its lines stand for them."""
    if ground is None:
        return set()
    own = {i: x[s.begin : s.end] for i, s in enumerate(shapes) if s.still and s.color is None and len(s.triangles)}
    return {i for i, v in own.items() if len(v) and abs(v[:, up].max() - ground) < 1e-9 * max(size, 1.0)}
